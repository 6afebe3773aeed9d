"""Of TCP connections whose data wait, each has its share in turn."""

import asyncio
from itertools import pairwise

from oarlock.live.transports.tcp import READ_BYTES, Tcp
from oarlock.live.transports.transport import Options

CHUNKS = 20


async def waiting_data_of_two():
    """Addresses in the order in which the data of two devices were delivered, which both sent all at once."""
    whole, delivered = b"x" * READ_BYTES * CHUNKS, []
    both, enough, writers = asyncio.Barrier(2), asyncio.Event(), []

    async def send(_, writer):
        writers.append(writer)
        await both.wait()
        writer.write(whole)

    def take(packet):
        delivered.append(packet.address)
        if len(delivered) >= 2 * CHUNKS:
            enough.set()

    servers = [await asyncio.start_server(send, "127.0.0.1", 0) for _ in range(2)]
    ports = [server.sockets[0].getsockname()[1] for server in servers]
    links = [Tcp("units", Options("units", {"host": "127.0.0.1", "port": port})) for port in ports]
    tasks = [asyncio.create_task(link.run(take)) for link in links]
    await enough.wait()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for one in (*writers, *servers):
        one.close()
        await one.wait_closed()
    return delivered


def test_two_devices_take_turns():
    delivered = asyncio.run(asyncio.wait_for(waiting_data_of_two(), 120.0))
    first = delivered[0]
    changes = sum(one != other for one, other in pairwise(delivered))
    assert delivered.count(first) == CHUNKS
    # One after the other it would be one change; the event loop may read one connection before the other has data.
    assert changes > CHUNKS
