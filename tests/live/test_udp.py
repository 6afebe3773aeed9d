"""Datagrams: stamped when the kernel received them, even if the program was busy then."""

import asyncio
import socket
import sys
import time

import pytest

from oarlock.live.transports.transport import Options
from oarlock.live.transports.udp import Udp, free_port


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says when it received a datagram")
def test_a_busy_program_delays_no_stamp():
    async def work():
        transport, got, port = None, [], free_port()
        transport = Udp("radio", Options("radio", {"port": port, "host": "127.0.0.1"}))
        running = asyncio.create_task(transport.run(got.append))
        while transport.state == "not started":
            await asyncio.sleep(0.001)
        sent_ns = []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(3):
                sent_ns.append(time.monotonic_ns())
                sender.sendto(bytes([number]), ("127.0.0.1", port))
                time.sleep(0.3)  # the loop cannot run
            address = f"127.0.0.1:{sender.getsockname()[1]}"
        read_ns = time.monotonic_ns()
        while len(got) < 3:
            await asyncio.sleep(0.001)
        running.cancel()
        return got, sent_ns, read_ns, address, transport.dropped

    got, sent_ns, read_ns, address, dropped = asyncio.run(asyncio.wait_for(work(), 30))
    assert [(p.data, p.address) for p in got] == [(bytes([n]), address) for n in range(3)]
    assert dropped in (0, None)
    for packet, at_ns in zip(got, sent_ns, strict=True):
        # Two clocks are read one after the other, which takes microseconds; a thread may be held up between.
        assert at_ns - 10**6 <= packet.arrival_ns <= read_ns - 2 * 10**8
