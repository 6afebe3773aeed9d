"""Emulated devices in real time, by the transports that real ones use: all that was sent arrives, in its order."""

import asyncio
from contextlib import asynccontextmanager, suppress
from itertools import islice

import numpy as np
import pytest
from mqtt_broker import Broker

import oarlock
from oarlock.live.decoders.lsl import HEADER, SAMPLES
from oarlock.live.reading import Packet
from oarlock.live.rig import Source
from oarlock.live.transports import opened
from oarlock.live.transports.ble import Ble
from oarlock.live.transports.transport import Options
from oarlock.live.transports.udp import free_port
from oarlock_lab.emulators import dot, ftms
from oarlock_lab.emulators.bluetooth import Air, VirtualRadio
from oarlock_lab.emulators.dot import Together
from oarlock_lab.emulators.emulated import Destination
from oarlock_lab.emulators.lsl import labels
from oarlock_lab.emulators.swinging import swinging
from oarlock_lab.soak.loopback import FAULTY, PERFECT, emulated_by

PATIENCE_S = 120.0


async def until(is_so):
    async with asyncio.timeout(PATIENCE_S):
        while not is_so():
            await asyncio.sleep(0.005)


async def ended(*tasks):
    for task in tasks:
        task.cancel()
    for task in tasks:
        with suppress(asyncio.CancelledError):
            await task


def sources_of(kind, emulated):
    wired = kind.device.wiring(emulated)
    return {
        own.source: Source(own.source, wired.format, own.transport, own.options, wired.decoder)
        for own in wired.senders.values()
    }


def run(work):
    return asyncio.run(asyncio.wait_for(work, PATIENCE_S))


# Devices that feed no sensor: a few seconds are enough


def brief(name, seconds=1.5, **place):
    time_s = np.array([0.0, seconds])
    recording = oarlock.Recording([oarlock.recording.ScalarStream("time", time_s, time_s)])
    return emulated_by(name, recording, PERFECT, place=Destination(**place))


@asynccontextmanager
async def listening(kind, emulated, has_begun):
    """Packets of a transport that listens to a device."""
    packets = []
    [source] = sources_of(kind, emulated).values()
    transport = opened(source)
    task = asyncio.create_task(transport.run(packets.append))
    try:
        await until(lambda: task.done() or has_begun(transport))
        yield packets
    finally:
        await ended(task)


def told(packets):
    return b"".join(packet.data for packet in packets)


def test_a_gps_receiver_by_datagrams():
    async def work():
        kind, emulated = brief("nmea", port=free_port())
        expected = [message.data for message in kind.device.messages(emulated)]
        async with listening(kind, emulated, lambda t: t.state.startswith("listens")) as packets:
            await kind.device.emulate(emulated)
            await until(lambda: len(packets) >= len(expected))
        assert [packet.data for packet in packets] == expected
        assert {p.address for p in packets} == {f"127.0.0.1:{emulated.place.port + 1}"}

    run(work())


def test_a_gps_receiver_by_serial_line(tmp_path):
    pytest.importorskip("serial", reason="needs pyserial, an extra")

    async def work():
        kind, emulated = brief("nmea", seconds=3600.0, transport="serial", path=tmp_path / "gps")
        device = asyncio.create_task(kind.device.emulate(emulated))
        await until((tmp_path / "gps").is_symlink)
        async with listening(kind, emulated, lambda t: t.state.startswith("reads")) as packets:
            await until(lambda: told(packets).count(b"RMC") > 10)
        await ended(device)
        expected = b"".join(m.data for m in islice(kind.device.messages(emulated), 10_000))
        # what came before the line was opened is lost, as with a real one
        assert told(packets) in expected
        assert {packet.address for packet in packets} == {str(tmp_path / "gps")}

    run(work())


def test_open_rowing_monitor_by_websocket():
    async def work():
        kind, emulated = brief("open_rowing_monitor", port=free_port())
        expected = [message.data for message in kind.device.messages(emulated)]
        device = asyncio.create_task(kind.device.emulate(emulated))
        async with listening(kind, emulated, lambda t: t.state.startswith("connected")) as packets:
            await device
            await until(lambda: len(packets) >= len(expected))
        assert [packet.data for packet in packets] == expected

    run(work())


def test_open_rowing_monitor_by_mqtt():
    pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt, an extra")

    async def work():
        async with Broker().there() as broker:
            kind, emulated = brief("open_rowing_monitor_mqtt", seconds=5.1, port=broker.port)
            expected = [message.data for message in kind.device.messages(emulated)]
            async with listening(kind, emulated, lambda t: t.state.startswith("listens")) as packets:
                await kind.device.emulate(emulated)
                await until(lambda: len(packets) >= len(expected))
        assert len(expected) == 2
        assert [(p.address, p.data) for p in packets] == [
            ("OpenRowingMonitor/erg/metrics", data) for data in expected
        ]

    run(work())


def test_a_machine_of_the_fitness_service_by_bluetooth():
    async def work():
        kind, emulated = brief("ftms", seconds=3.0)
        [(_, own)] = kind.device.wiring(emulated).senders.items()
        air, sent, packets = Air(), [], []
        device = asyncio.create_task(
            ftms.run(air.device(own.address), kind.device.messages(emulated), sent=sent.append)
        )
        ble = Ble("erg", Options("erg", {"profile": "ftms", **own.options}), VirtualRadio(air.device()))
        task = asyncio.create_task(ble.run(packets.append))
        await device
        await until(lambda: ble.state.startswith("lost"))
        await ended(task)
        assert len(sent) >= 2
        assert [(p.channel, p.data) for p in packets] == [(m.channel, m.data) for m in sent]

    run(work())


# Devices that measure a movement


@pytest.fixture(scope="module")
def recording(pendulum):
    return swinging(pendulum, 60.0, seed=2)[1]


def by_unit(kind, emulated, channels=()):
    """Source and address of each unit -> its messages, of these channels."""
    senders = kind.device.wiring(emulated).senders
    found = {(own.source, own.address): [] for own in senders.values()}
    for message in kind.device.messages(emulated):
        own = senders[message.unit]
        if not channels or message.channel in channels:
            found[own.source, own.address].append(message)
    return found


def assert_all_came(kind, emulated, packets, channels=()):
    """All that each unit sent is there, in its order."""
    expected = by_unit(kind, emulated, channels)
    for packet in packets:
        message = expected[packet.source, packet.address].pop(0)
        assert (packet.channel, packet.data) == (message.channel, message.data)
    assert not any(expected.values())


async def dots(kind, emulated):
    """Packets of all units, which begin to measure together."""
    air, packets, units = Air(), [], kind.device.wiring(emulated).senders
    together = Together(len(units))
    devices = [
        asyncio.create_task(dot.be(air.device(own.address), emulated, unit, begun=together.begun))
        for unit, own in units.items()
    ]
    options = {"profile": "dot", "mode": dot.MODE, **next(iter(units.values())).options}
    ble = Ble("dot", Options("dot", options), VirtualRadio(air.device()))
    task = asyncio.create_task(ble.run(packets.append))
    payloads = sum(len(messages) for messages in by_unit(kind, emulated).values())
    await until(lambda: task.done() or sum(p.channel != "15173001" for p in packets) == payloads)
    await ended(task, *devices)
    return [packet for packet in packets if packet.channel != "15173001"]


@pytest.mark.long
@pytest.mark.parametrize("faults", [PERFECT, FAULTY], ids=["perfect", "faulty"])
def test_dots_by_bluetooth(recording, faults):
    kind, emulated = emulated_by("dot", recording, faults)
    assert_all_came(kind, emulated, run(dots(kind, emulated)))


async def outlets(kind, emulated):
    """Packets of all streams of the Lab Streaming Layer; samples as if each had come by itself."""
    packets, width = [], 8 * (1 + len(labels(emulated.recording.streams[0])))
    count = sum(message.channel == SAMPLES for message in kind.device.messages(emulated))
    transports = [opened(source) for source in sources_of(kind, emulated).values()]
    tasks = [asyncio.create_task(transport.run(packets.append)) for transport in transports]
    await kind.device.emulate(emulated)
    await until(lambda: sum(len(p.data) for p in packets if p.channel == SAMPLES) == width * count)
    await ended(*tasks)
    return [one for packet in packets for one in one_by_one(packet, width)]


def one_by_one(packet, width):
    if packet.channel != SAMPLES:
        return [packet]
    parts = [packet.data[at : at + width] for at in range(0, len(packet.data), width)]
    return [Packet(packet.source, packet.address, SAMPLES, packet.arrival_ns, part) for part in parts]


@pytest.mark.long
@pytest.mark.parametrize("faults", [PERFECT, FAULTY], ids=["perfect", "faulty"])
def test_outlets_of_the_lab_streaming_layer(recording, faults):
    pylsl = pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    pylsl.set_config_content("[lab]\nSessionID = oarlock-test\n[multicast]\nResolveScope = machine\n")
    kind, emulated = emulated_by("lsl", recording, faults)
    packets = run(outlets(kind, emulated))
    assert sum(packet.channel == HEADER for packet in packets) == len(recording.streams)
    samples = [packet for packet in packets if packet.channel == SAMPLES]
    assert_all_came(kind, emulated, samples, (SAMPLES,))
