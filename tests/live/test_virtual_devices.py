"""Virtual Bluetooth devices over a link to the transport and the decoders: what was sent is what is read, all of it."""

import asyncio
import struct
from contextlib import suppress

import numpy as np
import pytest
from enough import EnoughError, Sent

from oarlock.live.decoders import DECODERS
from oarlock.live.transports.ble import Ble
from oarlock.live.transports.ble_profiles import kind_of
from oarlock.live.transports.radio import RadioError
from oarlock.live.transports.transport import Options
from oarlock.recording import ImuStream
from oarlock_lab.emulators import dot, heart_rate, pm5
from oarlock_lab.emulators.bluetooth import Air, VirtualRadio

ADDRESS = "F0:00:00:00:00:AA"


async def ended(*tasks):
    for task in tasks:
        task.cancel()
    for task in tasks:
        with suppress(asyncio.CancelledError):
            await task


async def heard(be, options):
    """Packets of a virtual device, which `be(device)` runs, until it has sent enough."""
    air = Air()
    emulator = asyncio.create_task(be(air.device(ADDRESS)))
    packets, states = [], set()
    transport = Ble("machine", Options("machine", options | {"address": ADDRESS}), VirtualRadio(air.device()))
    receiver = asyncio.create_task(transport.run(packets.append))
    while not emulator.done():
        await asyncio.sleep(0.01)
        states.add(transport.state)
        if receiver.done():
            receiver.result()
    with pytest.raises(EnoughError):
        await emulator
    # What was sent arrives before the end of the connection.
    while not transport.state.startswith("lost"):
        await asyncio.sleep(0.005)
    await ended(receiver)
    assert f"receives from {ADDRESS}" in states
    assert all(packet.source == "machine" and packet.address == ADDRESS for packet in packets)
    arrivals_ns = [packet.arrival_ns for packet in packets]
    assert arrivals_ns == sorted(arrivals_ns)
    return packets


# Half of what one count of a message is, in the order of what the decoder names.
STEPS = {
    "elapsed_s": 0.01,
    "distance_m": 0.1,
    "speed_m_s": 0.001,
    "pace_s_per_500_m": 0.01,
    "handle_travel_m": 0.01,
    "drive_time_s": 0.01,
    "recovery_time_s": 0.01,
    "distance_per_stroke_m": 0.01,
    "peak_force_n": 0.1 * 4.4482216152605,
    "mean_force_n": 0.1 * 4.4482216152605,
    "handle_force_n": 4.4482216152605,
    "work_j": 0.1,
}


def assert_read_as_sent(readings, sent):
    assert len(readings) == len(sent)
    for reading, (number, values) in zip(readings, sent, strict=True):
        expected = dict(values) if number != 0x3D else {"handle_force_n": values}
        for name in reading.values.keys() & expected.keys():
            atol = 0.5 * STEPS.get(name, 1.0) + 1e-9
            np.testing.assert_allclose(
                reading.values[name], expected[name], rtol=0.0, atol=atol, err_msg=name
            )


def test_pm5_that_rows():
    sent = Sent(lambda sent: sum(number == 0x35 for number, _ in sent) == 12)
    rowing = pm5.Rowing(rate_per_min=30.0, drive_s=0.75)

    packets = asyncio.run(
        heard(
            lambda device: pm5.run(device, rowing, speed=15.0, sent=sent),
            {"profile": "pm5", "period_ms": 100},
        )
    )
    decoder = DECODERS["pm5"].decoder()
    readings = [reading for packet in packets for reading in decoder.decode(packet.data, packet.channel)]
    assert decoder.damaged == 0
    assert_read_as_sent(readings, sent)
    assert {packet.channel for packet in packets} == {
        f"CE0600{n:02X}" for n in (0x31, 0x32, 0x33, 0x35, 0x36, 0x3D, 0x3E)
    }
    complete = [reading.values for reading in readings if reading.device == "stroke"]
    assert len(complete) >= 3
    assert {values["drive_time_s"] for values in complete} == {0.75}
    assert {values["recovery_time_s"] for values in complete} == {1.25}
    numbers = [values["stroke_number"] for values in complete]
    assert numbers == list(range(int(numbers[0]), int(numbers[0]) + len(numbers)))
    curves = [reading.values["handle_force_n"] for reading in readings if "handle_force_n" in reading.values]
    assert {len(curve) for curve in curves} == {75}
    elapsed = [reading.values["elapsed_s"] for reading in readings if "drag_factor" in reading.values]
    # The status comes each 100 ms once 0x0034 has been written; before that each 500 ms.
    assert np.median(np.diff(elapsed)) == pytest.approx(0.1, abs=1e-9)


def test_pm5_of_which_only_the_multiplexed_characteristic_is_heard():
    sent, messages = Sent(lambda sent: sum(number == 0x35 for number, _ in sent) == 6), []

    async def listen():
        air = Air()
        emulator = asyncio.create_task(pm5.run(air.device(ADDRESS), speed=15.0, sent=sent))
        radio = VirtualRadio(air.device())
        while not (found := await radio.scan(0.1)):
            pass
        [found] = found
        assert (found.address, found.name, kind_of(found.name, found.services)) == (
            ADDRESS,
            "PM5 430000000",
            "pm5",
        )
        lost = asyncio.Event()
        await radio.connect(ADDRESS, lost.set)
        await radio.subscribe(ADDRESS, "ce060080-43e5-11e4-916c-0800200c9a66", messages.append)
        with pytest.raises(EnoughError):
            await emulator
        await lost.wait()
        await radio.disconnect(ADDRESS)

    asyncio.run(listen())
    decoder = DECODERS["pm5"].decoder()
    readings = [reading for data in messages for reading in decoder.decode(data, "CE060080")]
    assert decoder.damaged == 0
    assert_read_as_sent(readings, sent)
    assert {reading.device for reading in readings} == {"status", "drive", "stroke"}


def test_heart_rate_belt():
    sent = Sent(lambda sent: len(sent) == 40)
    packets = asyncio.run(
        heard(
            lambda device: heart_rate.run(device, speed=50.0, sent=sent),
            {"profile": "heart_rate"},
        )
    )
    decoder = DECODERS["heart_rate"].decoder()
    readings = [reading for packet in packets for reading in decoder.decode(packet.data, packet.channel)]
    assert len(readings) == len(sent) == 40
    for reading, (rate_per_min, rr_s) in zip(readings, sent, strict=True):
        assert reading.values["heart_rate_per_min"] == round(rate_per_min)
        np.testing.assert_allclose(reading.values["rr_s"], rr_s, rtol=0.0, atol=0.5 / 1024 + 1e-12)
        assert reading.values["skin_contact"] == 1.0


def wavering(count=120, rate_hz=60.0):
    rng = np.random.default_rng(3)
    time_s = 5.0 + np.arange(count) / rate_hz
    values = [scale * rng.standard_normal((count, 3)) for scale in (5.0, 15.0, 40.0)]
    values[0][17] = np.nan
    return ImuStream("forearm", time_s, *values)


# Little-endian layouts of the payloads, from the specification.
LAYOUTS = {20: ("<I6f3h", 40), 21: ("<I6f", 40), 26: ("<I10f", 63)}


@pytest.mark.parametrize("mode", [20, 21, 26])
def test_dot_that_replays_a_stream(mode):
    stream, sent = wavering(), Sent(lambda sent: sent[-1] == (119,))
    rng = np.random.default_rng(4)
    quat = rng.standard_normal((120, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    # The stamp wraps within the replay.
    first_us = (1 << 32) - 1_000_000
    packets = asyncio.run(
        heard(
            lambda device: dot.run(device, stream, quat_wxyz=quat, first_us=first_us, speed=10.0, sent=sent),
            {"profile": "dot", "mode": mode},
        )
    )
    battery, *payloads = packets
    assert (battery.channel, battery.data) == ("15173001", bytes([88, 0]))
    rows = [row for (row,) in sent]
    assert rows == [row for row in range(120) if row != 17]
    layout, length = LAYOUTS[mode]
    assert {len(packet.data) for packet in payloads} == {length}
    decoder = DECODERS["dot"].decoder(mode=mode)
    for packet, row in zip(payloads, rows, strict=True):
        expected = {"accel_m_s2": stream.accel_m_s2[row], "gyro_rad_s": stream.gyro_rad_s[row]}
        further = {20: {"mag_arbitrary": stream.mag_ut[row] / 50.0}, 26: {"quat_wxyz": quat[row]}}
        expected |= further.get(mode, {})
        stamp, *numbers = struct.unpack_from(layout, packet.data)
        assert stamp == (first_us + round(1e6 * (stream.time_s[row] - 5.0))) % (1 << 32)
        first = 4 if mode == 26 else 0
        np.testing.assert_allclose(numbers[first : first + 3], expected["accel_m_s2"], rtol=1e-6)
        [reading] = decoder.decode(packet.data, packet.channel)
        assert reading.clock_s - first_us / 1e6 == pytest.approx(stream.time_s[row] - 5.0, abs=1e-6)
        assert reading.values.keys() == expected.keys()
        for name, values in expected.items():
            atol = 0.5 / 4096 if name == "mag_arbitrary" else 1e-6
            np.testing.assert_allclose(reading.values[name], values, rtol=1e-6, atol=atol, err_msg=name)
    assert decoder.damaged == 0


def test_dot_that_is_started_before_it_is_heard_sends_nothing():
    rows = []

    async def start():
        air = Air()
        emulator = asyncio.create_task(
            dot.run(air.device(ADDRESS), wavering(), speed=100.0, sent=rows.append)
        )
        radio = VirtualRadio(air.device())
        await asyncio.sleep(0.05)
        await radio.connect(ADDRESS, lambda: None)
        await radio.write(ADDRESS, "15172001-4947-11e9-8646-d663bd873d93", bytes([1, 1, 20]))
        await asyncio.sleep(0.2)
        with pytest.raises(RadioError, match="no characteristic"):
            await radio.write(ADDRESS, "15179999-4947-11e9-8646-d663bd873d93", b"")
        await ended(emulator)

    asyncio.run(start())
    assert rows == []
