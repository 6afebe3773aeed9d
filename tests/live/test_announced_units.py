"""A rig file names x-IMU3 units; their addresses are found from what they announce."""

import asyncio

import pytest
from while_listening import is_bound
from wire_samples import ximu3, ximu3_announcement

from oarlock.live.decoders import ximu3_announcement as announcements
from oarlock.live.rig import Source
from oarlock.live.transports import opened
from oarlock.live.transports.announced import Announcements, shared_socket
from oarlock.live.transports.udp import free_port
from oarlock.storage.errors import DataError


@pytest.fixture
def announced_at(monkeypatch):
    port = free_port()
    monkeypatch.setattr(announcements, "PORT", port)
    return port


async def tell(port, *units):
    """Announces units as they do, without end."""
    loop = asyncio.get_running_loop()
    sender, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, remote_addr=("127.0.0.1", port))
    try:
        while True:
            for unit in units:
                sender.sendto(unit)
            await asyncio.sleep(0.02)
    finally:
        sender.close()


async def received(transport, is_enough, *others):
    got = []
    tasks = [asyncio.create_task(transport.run(got.append)), *map(asyncio.ensure_future, others)]
    while not is_enough(got):
        await asyncio.sleep(0.005)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return got


async def unit_server(sent, clients=None):
    async def serve(reader, writer):
        if clients is not None:
            clients.append(writer)
        writer.write(sent)
        await reader.read()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    return server, server.sockets[0].getsockname()[1]


def within_a_minute(work):
    return asyncio.run(asyncio.wait_for(work, 60))


def test_units_are_connected_by_serial_number_or_name(announced_at):
    async def work():
        back, port = await unit_server(b"one\n")
        hand, other = await unit_server(b"two\n")
        transport = opened(Source("units", "ximu3", "tcp", {"units": ["65577b49", "Right hand"]}))
        told = tell(
            announced_at,
            ximu3_announcement(port),
            ximu3_announcement(other, name="Right hand", serial="AB12"),
        )
        async with back, hand:
            got = await received(transport, lambda got: len(got) >= 2, told)
        assert "connected to x-IMU3 65577b49" in transport.state
        return {packet.address: packet.data for packet in got}

    assert within_a_minute(work()) == {"65577b49": b"one\n", "Right hand": b"two\n"}
    assert not is_bound(announced_at)


def test_a_unit_that_comes_back_elsewhere_is_found_there(announced_at):
    async def work():
        clients = []
        first, port = await unit_server(b"before", clients)
        second, other = await unit_server(b"after")
        transport = opened(Source("units", "ximu3", "tcp", {"units": ["65577B49"]}))

        async def moves():
            telling = asyncio.create_task(tell(announced_at, ximu3_announcement(port)))
            while not clients:
                await asyncio.sleep(0.005)
            telling.cancel()
            first.close()
            telling = asyncio.create_task(tell(announced_at, ximu3_announcement(other)))
            await asyncio.sleep(0.05)
            clients[0].close()
            await telling

        async with second:
            got = await received(transport, lambda got: any(p.data == b"after" for p in got), moves())
        return [packet.data for packet in got]

    assert within_a_minute(work()) == [b"before", b"after"]


def test_a_unit_that_does_not_announce_itself_is_said_to_be_missing(announced_at, monkeypatch):
    monkeypatch.setattr("oarlock.live.transports.announced.WAIT_S", 0.02)

    async def work():
        transport = opened(Source("units", "ximu3", "tcp", {"units": ["65577B49"]}))
        running = asyncio.create_task(transport.run(lambda packet: None))
        while "lost" not in transport.state:
            await asyncio.sleep(0.005)
        running.cancel()
        return transport.state

    assert "no x-IMU3 65577B49 announces itself" in within_a_minute(work())


def test_datagrams_are_of_the_unit_that_announced_their_address(announced_at):
    async def work():
        port = free_port()
        transport = opened(Source("units", "ximu3", "udp", {"port": port, "units": ["Back"]}))

        async def sends():
            while not is_bound(port):
                await asyncio.sleep(0.005)
            await tell(port, *ximu3(count=3))

        got = await received(
            transport,
            lambda got: got and got[-1].address == "Back",
            tell(announced_at, ximu3_announcement(7000)),
            sends(),
        )
        return {packet.address for packet in got}

    addresses = within_a_minute(work())
    assert "Back" in addresses
    assert all(address == "Back" or address.startswith("127.0.0.1:") for address in addresses)


def test_other_programs_may_hear_announcements_too(announced_at):
    async def work():
        with shared_socket(announced_at):
            async with Announcements(), Announcements():
                assert is_bound(announced_at)

    within_a_minute(work())


@pytest.mark.parametrize("transport", ["tcp", "udp"])
def test_a_port_of_announcements_that_is_taken_is_said(announced_at, transport):
    import socket

    async def work():
        options = {"units": ["AA"]} | ({"port": free_port()} if transport == "udp" else {})
        await opened(Source("units", "ximu3", transport, options)).run(lambda packet: None)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("0.0.0.0", announced_at))
        with pytest.raises(DataError, match="cannot hear which x-IMU3 units"):
            within_a_minute(work())
