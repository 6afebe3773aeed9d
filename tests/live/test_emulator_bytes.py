"""Bytes of emulated devices: published vectors, other people's encoders, and what decoders make of them."""

import json
import struct

import numpy as np
import pytest
from pythonosc.osc_bundle import OscBundle

from decoded import as_bytes
from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.ximu3_announcement import announcement
from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators import mvn, ngimu, shimmer3, text, vicon, ximu3
from oarlock_lab.emulators.kinds import KINDS
from oarlock_lab.emulators.osc import osc_bundle, osc_message
from oarlock_lab.emulators.swinging import swinging
from oarlock_lab.soak.loopback import PERFECT, emulated_by, packets_of

ZERO = "00000000"


@pytest.fixture(scope="module")
def swung(pendulum):
    return swinging(pendulum, 50.0, seed=3)[1].slice(end_s=1.0)


@pytest.mark.parametrize(
    ("letter", "numbers", "expected"),
    [
        ("I", (0, 0, 0, 0, 0, 1), "C9 40420F0000000000" + 5 * ZERO + "0000803F 0A"),
        ("Q", (1, 0, 0, 0), "D1 40420F0000000000 0000803F" + 3 * ZERO + "0A"),
        ("B", (100, 4.2, 2), "C2 40420F0000000000 0000C842 66668640 00000040 0A"),
    ],
)
def test_the_published_messages_of_an_ximu3(letter, numbers, expected):
    assert ximu3.binary(letter, 1_000_000, numbers) == as_bytes(expected)


def test_bytes_that_end_a_message_are_stuffed():
    assert ximu3.stuffed(as_bytes("45 0A 41 4D 50 4C 45")) == as_bytes("45 DB DC 41 4D 50 4C 45")
    assert ximu3.stuffed(as_bytes("45 58 41 4D 50 DB 0A")) == as_bytes("45 58 41 4D 50 DB DD DB DC")
    made = ximu3.binary("I", 2570, (10, -2.5, 0, 0, -0.5, 0.8660254))
    assert made == as_bytes(
        "C9 DBDC DBDC 000000000000 00002041 000020C0 00000000 00000000 000000BF D7B35D3F 0A"
    )


def test_an_ximu3_announces_its_ports_as_it_sees_them(swung):
    _, emulated = emulated_by("ximu3", swung, PERFECT)
    found = announcement(ximu3.announcement(emulated, 1))
    assert (found.name, found.address, found.udp_sends_to) == ("middle", "127.0.0.1", 8000)
    assert found.tcp_port == found.udp_listens == 8002


def test_a_bundle_of_an_ngimu_is_that_of_another_encoder():
    numbers = (1, 2, 3, 0, 0, 1, 20, 0, -40, 1013.25)
    made = osc_bundle(1_800_000_000.125 + 2_208_988_800, [osc_message("/sensors", numbers)])
    assert made == as_bytes(
        "2362756e646c6500 eef4508020000000 00000040 2f73656e736f727300000000 2c6666666666666666666600"
        "3f800000 40000000 40400000 00000000 00000000 3f800000 41a00000 00000000 c2200000 447d5000"
    )


def test_another_decoder_reads_the_bundles_of_an_ngimu():
    values = {"gyro_rad_s": (np.pi, 0.0, 0.0), "accel_m_s2": (0.0, 0.0, 9.80665), "mag_ut": (1.0, 2.0, 3.0)}
    sensors, battery = OscBundle(ngimu.packet(Delivery(0.0, "hand", 12.5, 0, values)))
    assert (sensors.address, battery.address) == ("/sensors", "/battery")
    np.testing.assert_allclose(sensors.params, [180, 0, 0, 0, 0, 1, 1, 2, 3, 1013.25], rtol=1e-6)


def test_a_datagram_of_mvn_is_the_one_made_from_the_document():
    made = mvn.datagram(b"MXTP02", 1234, 5.678, [mvn.pose(1, (1, 0, 0, 0), (0.1, 0.2, 0.9))])
    assert made == as_bytes(
        "4d5854503032 000004d2 80 01 0000162e 00 17 00 00 0000 0020 00000001 3dcccccd 3e4ccccd 3f666666 3f800000"
        "000000000000000000000000"
    )


def test_streams_of_mvn_without_the_name_of_a_segment_get_a_free_one():
    found = mvn.segments(["shank", "pelvis", "left_hand"])
    assert found == {"pelvis": 1, "left_hand": 15, "shank": 2}


def test_a_shimmer3_answers_commands(swung):
    _, emulated = emulated_by("shimmer3", swung, PERFECT)
    units = shimmer3.Units(emulated)
    inquiry = units.answer("upper", b"\x01")
    assert inquiry == b"\xff\x02" + struct.pack("<HIBB", 655, 0x0901FF01, 9, 1) + bytes(
        [0, 1, 2, 10, 11, 12, 7, 8, 9]
    )
    assert units.answer("upper", as_bytes("05 80 02 08 00 00 00 03")) == b"\xff\xff\xff\x04" + b"\x8f\x02"
    assert len(units.answer("upper", b"\x2c")) == 2 + 84
    assert units.answer("upper", b"\x07") == b"\xff"
    sent = [message for message in units.streaming() if message.data]
    assert {message.unit for message in sent} == {"upper"} and len(sent) == len(swung.sensor("upper"))
    assert units.answer("upper", b"\x20") == b"\xff"
    assert not [message for message in units.streaming() if message.data]


def test_counts_of_a_shimmer3_stay_in_their_range():
    made = shimmer3.data_packet(512.0, (1e3, -1e3, 0.0), (1e3, -1e3, 0.0), (1e5, -1e5, 0.0))
    assert made[:4] == bytes(4)
    assert struct.unpack("<3h", made[4:10]) == (4095, 0, 2047)
    assert struct.unpack(">3h", made[10:16]) == struct.unpack("<3h", made[16:]) == (32767, -32768, 0)


def test_a_frame_of_vicon():
    made = vicon.datagram(7, [("wrist", (0.1, -0.2, 0.9))])
    assert made[:8] == struct.pack("<IBBH", 7, 1, 0, 72)
    assert made[8:32] == b"wrist" + bytes(19)
    np.testing.assert_allclose(struct.unpack("<6d", made[32:]), [100, -200, 900, 0, 0, 0])


def test_a_line_of_text_has_the_order_of_the_protocol():
    values = {"gyro_rad_s": (4.0, 5.0, 6.0), "accel_m_s2": (1.0, 2.0, 3.0), "mag_ut": (7.0, 8.0, 9.0)}
    assert text.line(Delivery(0.0, "hand", 2.5, 3, values)) == b"2500000,3,1,2,3,4,5,6,7,8,9\n"
    del values["mag_ut"]
    assert text.line(Delivery(0.0, "hand", 2.5, 2**32, values)) == b"2500000,0,1,2,3,4,5,6\n"


# Largest difference of a rate (rad/s) and of a specific force (m/s2): half a count of the wire.
COUNTS = {
    "shimmer3": (np.radians(0.5 / 65.5), 0.5 / 83.0),
    "ximu3_text": (np.radians(5e-5), 9.80665 * 5e-5),
}


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if "imu" in kind.streams])
def test_what_is_decoded_is_what_was_measured(swung, name):
    kind, emulated = emulated_by(name, swung, PERFECT)
    wired = kind.device.wiring(emulated)
    sources = {own.address: own for own in wired.senders.values()}
    decoders, found = {}, {}
    for packet in packets_of(kind, emulated):
        transport = sources[packet.address].transport
        if packet.address not in decoders:
            decoders[packet.address] = DECODERS[wired.format].decoder(transport, **wired.decoder)
        for reading in decoders[packet.address].decode(packet.data, packet.channel):
            if "gyro_rad_s" in reading.values:
                found.setdefault((packet.address, reading.device), []).append(reading.values)
    assert not any(decoder.damaged for decoder in decoders.values())
    gyro_rad_s, accel_m_s2 = COUNTS.get(name, (1e-6, 1e-5))
    for stream in swung.streams:
        unit, part = wired.streams[stream.name]
        rows = found[(wired.senders[unit].address, part)]
        for key, atol in (("gyro_rad_s", gyro_rad_s), ("accel_m_s2", accel_m_s2)):
            told = np.array([row[key] for row in rows])
            np.testing.assert_allclose(told, stream.values[key], rtol=1e-6, atol=1.01 * atol)


def test_markers_are_sent_as_positions(swung):
    from oarlock import Recording
    from oarlock.recording import VectorStream

    place = VectorStream("wrist", np.arange(5) / 10.0, np.full((5, 3), 0.25))
    kind, emulated = emulated_by("lines", Recording([place]), PERFECT)
    told = [json.loads(packet.data) for packet in packets_of(kind, emulated)]
    assert [one["position_m"] for one in told] == 5 * [[0.25, 0.25, 0.25]]
