"""Movella DOT, Xsens MVN, Shimmer3, Vicon Tracker: published vectors, packets made from documents, wraps, damage."""

import math
import struct

import pytest
from scipy.spatial.transform import Rotation

from decoded import as_bytes, damaged, near, one, readings
from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.dot import OUT_OF_RANGE
from oarlock.live.decoders.dot_messages import message, message_of, output_rate, start, stop

POSE = as_bytes(
    "4d5854503032 000004d2 80 01 0000162e 00 17 00 00 0000 0020 00000001 3dcccccd 3e4ccccd 3f666666 3f800000"
    "000000000000000000000000"
)
INQUIRY = as_bytes("02 40 00 01 FF 01 09 01 01 12")
FIRST, SECOND = as_bytes("00 DED0B2 2607"), as_bytes("00 1ED1B2 FC06")


def dot(mode, *numbers, form, **options):
    """The values of a payload at 1 s."""
    found = one("dot", struct.pack("<I" + form, 1_000_000, *numbers), mode=mode, **options)
    assert found.clock_s == 1.0
    return found.values


def test_the_published_payload_of_a_dot():
    found = one("dot", "D8052244 AF964040 6B2AA740 5ADD14C0 00000000", mode=6)
    assert found.clock_s == pytest.approx(1143.080408, abs=1e-9)
    assert found.values == {"earth_free_accel_m_s2": near((3.009197, 5.223928, -2.326010), rel=1e-6)}


def test_raw_readings_of_a_dot():
    values = dot(20, 0.1, 0.2, 9.8, 90, 0, -180, 4096, -2048, 0, form="6f3h")
    assert values["accel_m_s2"] == near((0.1, 0.2, 9.8), rel=1e-6)
    assert values["gyro_rad_s"] == pytest.approx((math.pi / 2, 0, -math.pi))
    assert values["mag_arbitrary"] == (1.0, -0.5, 0.0)
    assert "mag_arbitrary" not in dot(21, 0, 0, 9.8, 0, 0, 0, form="6f")


@pytest.mark.parametrize(
    ("mode", "size"),
    [
        *(
            (2, 36),
            (3, 32),
            (4, 16),
            (5, 20),
            (6, 16),
            (7, 32),
            (16, 28),
            (18, 38),
            (19, 32),
            (20, 34),
            (21, 28),
        ),
        *((22, 40), (23, 34), (24, 32), (26, 44)),
    ],
)
def test_payloads_have_the_length_of_their_mode_and_zeros_behind(mode, size):
    turned = struct.pack("<I4f", 5, 1, 0, 0, 0) if mode in (2, 3, 5, 24, 26) else bytes(4)
    whole = turned + bytes(size - len(turned))
    assert damaged("dot", whole[:-1], mode=mode) == 1
    assert damaged("dot", whole + bytes(10) + b"\x01", mode=mode) == 1
    assert len(readings("dot", whole, whole + bytes(63 - size), mode=mode)) == 2


def test_flags_name_the_axes_beyond_their_range():
    values = dot(2, 1, 0, 0, 0, 0, 0, 0, 0b000_010_001, 0, 0, form="7fHBB")
    assert values["out_of_range"] == "accel_x gyro_y"
    assert "out_of_range" not in dot(2, 1, 0, 0, 0, 0, 0, 0, 0x0200, 0, 0, form="7fHBB")
    assert len(OUT_OF_RANGE) == 9


def test_angles_of_a_dot_are_a_quaternion():
    turn = Rotation.from_euler("ZYX", [30, -20, 10], degrees=True).as_quat()[[3, 0, 1, 2]]
    assert dot(4, 10, -20, 30, form="3f")["quat_wxyz"] == pytest.approx(tuple(turn))


def test_the_clock_of_a_dot_wraps_and_a_late_packet_does_not_add_an_hour():
    ticks = [2**32 - 20_000, 2**32 - 10_000, 0, 2**32 - 5_000, 10_000]
    found = readings("dot", *(struct.pack("<I4f", t, 1, 0, 0, 0) for t in ticks), mode=5)
    assert [round(1e6 * r.clock_s) - ticks[0] for r in found] == [0, 10_000, 20_000, 15_000, 30_000]


def test_other_characteristics_of_a_dot():
    base = "1517{}-4947-11E9-8646-D663BD873D93"
    assert one("dot", b"\x50\x01", channel=base.format("3001")).values == {
        "battery_percent": 80.0,
        "charging": 1.0,
    }
    assert one("dot", "02025109A2", channel=base.format("7003")).values == {"answer": "02 51 09"}
    assert readings("dot", b"rubbish", channel=base.format("1004")) == []
    assert damaged("dot", b"\xff\x00", b"", channel=base.format("3001")) == 2
    payload = struct.pack("<I6f", 0, 0, 0, 9.8, 0, 0, 0)
    for channel in ("2002", "2003", "2004"):
        assert len(readings("dot", payload, channel=base.format(channel), mode=21)) == 1


@pytest.mark.parametrize(
    ("sent", "service", "content"),
    [
        ("01 01 02 FC", 1, "02"),
        ("01 03 01 06 02 F3", 1, "01 06 02"),
        ("02 01 08 F5", 2, "08"),
        ("02 02 51 09 A2", 2, "51 09"),
        ("02 02 51 04 A7", 2, "51 04"),
        ("02 01 02 FB", 2, "02"),
        ("02 02 50 00 AC", 2, "50 00"),
        ("03 01 04 F8", 3, "04"),
    ],
)
def test_the_published_messages(sent, service, content):
    assert message(service, as_bytes(content)) == as_bytes(sent)
    assert message_of(as_bytes(sent)) == (service, as_bytes(content))
    assert message_of(as_bytes(sent) + bytes(20)) == (service, as_bytes(content))
    assert message_of(as_bytes(sent)[:-1]) is None
    assert message_of(as_bytes(sent)[:-1] + b"\x7f") is None


def test_commands():
    assert (start(20), stop(20)) == (b"\x01\x01\x14", b"\x01\x00\x14")
    assert output_rate(60) == as_bytes("10" + "00" * 23 + "3C00" + "00" * 6)
    assert len(output_rate(60)) == 32
    with pytest.raises(ValueError, match="rate_hz is 120"):
        output_rate(120)
    with pytest.raises(ValueError, match="mode is 1;"):
        DECODERS["dot"].decoder(mode=1)


def mxtp(kind, sample, time_ms, *items, character=0, old=False):
    body = b"".join(items)
    tail = bytes(7) if old else struct.pack(">BBB2xH", 23, 0, 0, len(body))
    head = b"MXTP%02d" % kind + struct.pack(">IBBIB", sample, 0x80, len(items), time_ms, character)
    return head + tail + body


def tracker(segment, *more):
    return struct.pack(f">I{7 + len(more)}f", segment, 1, 0, 0, 0, 0.1, 0.2, 0.3, *more)


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_the_pose_of_a_pelvis(transport):
    assert len(POSE) == 56
    found = one("mvn", POSE, transport=transport)
    assert (found.device, found.clock_s, found.count) == ("pelvis", 5.678, 1234)
    assert found.values == {"position_m": near((0.1, 0.2, 0.9)), "quat_wxyz": (1, 0, 0, 0)}


def test_the_names_of_segments():
    pose = POSE[28:]
    items = [k.to_bytes(4, "big") + pose for k in (8, 11, 23, 24)]
    found = readings("mvn", mxtp(2, 1, 0, *items, character=1), transport="udp")
    assert [r.device for r in found] == ["1/right_shoulder", "1/right_hand", "1/left_toe", "1/segment_24"]


def test_trackers_with_and_without_raw_readings():
    short, long = tracker(10, 0.4, 0.5, 0.6), tracker(10, 0, 0, 9.8, 90, 0, 0, 0.4, 0.5, 0.6)
    assert (len(short), len(long)) == (44, 68)
    found = one("mvn", mxtp(23, 1, 0, short))
    assert found.device == "right_fore_arm_sensor"
    assert found.values == {
        "quat_wxyz": (1, 0, 0, 0),
        "earth_free_accel_m_s2": near((0.1, 0.2, 0.3)),
        "mag_arbitrary": near((0.4, 0.5, 0.6)),
    }
    values = one("mvn", mxtp(23, 1, 0, long)).values
    assert values["accel_m_s2"] == near((0, 0, 9.8))
    assert values["gyro_unknown_unit"] == (90, 0, 0)
    assert one("mvn", mxtp(23, 1, 0, long), gyro_unit="deg/s").values["gyro_rad_s"] == near(
        (math.pi / 2, 0, 0)
    )
    assert one("mvn", mxtp(23, 1, 0, long), gyro_unit="rad/s").values["gyro_rad_s"] == (90, 0, 0)
    with pytest.raises(ValueError, match="gyro_unit"):
        DECODERS["mvn"].decoder(gyro_unit="rpm")


def test_headers_before_mvn_2019():
    sent = [mxtp(23, k, 10 * k, tracker(10, 0.4, 0.5, 0.6), old=True) for k in range(3)]
    assert [r.count for r in readings("mvn", *sent, transport="udp")] == [0, 1, 2]
    # In a stream the next header shows where a message ends.
    assert [r.count for r in readings("mvn", *sent, transport="tcp")] == [0, 1]


def test_the_sample_counter_shows_a_loss_and_wraps():
    samples = [2**32 - 4, 2**32 - 2, 0, 6]
    found = readings("mvn", *(mxtp(2, k, 0, POSE[24:]) for k in samples), every=2)
    assert [r.count - found[0].count for r in found] == [0, 1, 2, 5]


def test_other_types_give_no_reading():
    assert readings("mvn", mxtp(24, 1, 0, bytes(12)), mxtp(25, 1, 0, bytes(16)), transport="udp") == []


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        POSE[:20],
        POSE[:-1],
        POSE + b"\0",
        b"X" + POSE,
        mxtp(2, 1, 0, bytes(32)),
        mxtp(23, 1, 0, bytes(40)),
    ],
)
def test_damaged_datagrams_are_counted(sent):
    assert damaged("mvn", sent, transport="udp") == 1


def test_the_published_packets_of_a_shimmer():
    found = readings("shimmer3", INQUIRY, FIRST, SECOND)
    assert [r.values for r in found] == [{"adc_13_counts": 1830.0}, {"adc_13_counts": 1788.0}]
    assert [32768 * r.clock_s for r in found] == [11718878, 11718942]
    assert found[1].clock_s - found[0].clock_s == 1 / 512


def test_a_shimmer_with_acknowledgements_and_status_in_the_stream():
    found = readings("shimmer3", b"\xff" + INQUIRY + b"\xff\xff", FIRST, b"\xff\x8a\x71\x21", SECOND)
    assert len(found) == 2


def imu_inquiry(period=640):
    channels = bytes([0, 1, 2, 4, 5, 6, 0x0A, 0x0B, 0x0C, 7, 8, 9])
    return b"\x02" + struct.pack("<HIBB", period, 0x0901FF01, len(channels), 1) + channels


def imu_packet(ticks, low=(0, 0, 0), wide=(0, 0, 0), gyro=(0, 0, 0), mag=(0, 0, 0)):
    return (
        b"\0"
        + ticks.to_bytes(4, "little")[:3]
        + struct.pack("<6h", *low, *wide)
        + struct.pack(">3h", *gyro)
        + struct.pack("<3h", *mag)
    )


def calibration(accel_ln=(2000, 83), gyro=(-100, 6550), mag=(-800, 700), accel_wr=(-370, 1650)):
    identity = bytes([100, 0, 0, 0, 100, 0, 0, 0, 100])
    sensors = (accel_ln, gyro, mag, accel_wr)
    return b"\x2d" + b"".join(struct.pack(">6h", *[b] * 3, *[s] * 3) + identity for b, s in sensors)


def test_byte_orders_and_counts_without_calibration():
    found = one("shimmer3", imu_inquiry(), imu_packet(0, (1, -2, 3), (4, 5, 6), (-7, 8, 9), (10, -11, 12)))
    assert found.values == {
        "accel_ln_counts": (1, -2, 3),
        "accel_wr_counts": (4, 5, 6),
        "gyro_counts": (-7, 8, 9),
        "mag_counts": (10, -11, 12),
    }


def test_units_with_a_calibration():
    sent = imu_packet(0, (2083, 2000, 1917), (-370, -370, 1280), (-100, 31, -100), (-100, -800, -800))
    values = one("shimmer3", calibration(), imu_inquiry(), sent).values
    assert values["accel_m_s2"] == pytest.approx((1, 0, -1))
    assert values["accel_wr_m_s2"] == pytest.approx((0, 0, 1))
    assert values["gyro_rad_s"] == pytest.approx((0, math.radians(2), 0))
    assert values["mag_arbitrary"] == pytest.approx((1, 0, 0))
    wide = one("shimmer3", calibration(), imu_inquiry(), sent, accel="WR").values
    assert wide["accel_m_s2"] == values["accel_wr_m_s2"]
    assert wide["accel_ln_m_s2"] == values["accel_m_s2"]


def test_an_alignment_turns_the_axes():
    identity = struct.pack(">6h9b", 0, 0, 0, 1, 1, 1, 0, -100, 0, -100, 0, 0, 0, 0, -100)
    sent = b"\x2d" + identity + calibration()[22:]
    values = one("shimmer3", sent, imu_inquiry(), imu_packet(0, (1, 2, 3))).values
    assert values["accel_m_s2"] == pytest.approx((-2, -1, -3))


def test_a_sensor_whose_memory_was_never_written_keeps_counts():
    sent = calibration(gyro=(-1, -1))
    values = one("shimmer3", sent, imu_inquiry(), imu_packet(0)).values
    assert "gyro_counts" in values
    assert "accel_m_s2" in values


def test_the_clock_of_a_shimmer_wraps_after_512_s():
    sent = [imu_packet((2**24 - 1280 + 640 * k) % 2**24) for k in range(5)]
    found = readings("shimmer3", imu_inquiry(), *sent)
    steps = [32768 * (r.clock_s - found[0].clock_s) for r in found]
    assert steps == [0, 640, 1280, 1920, 2560]


def test_an_inquiry_may_be_given():
    sent = [imu_packet(640 * k) for k in range(6)]
    decoder = DECODERS["shimmer3"].decoder(inquiry=imu_inquiry()[1:].hex())
    found = decoder.decode(b"".join(sent)[11:])
    # The last ones wait for what follows them, the first was cut.
    assert [32768 * r.clock_s for r in found] == [640, 1280, 1920, 2560, 3200]
    for wrong in ("00", "4000 01FF0109 01 01 77"):
        with pytest.raises(ValueError, match="inquiry"):
            DECODERS["shimmer3"].decoder(inquiry=wrong)
    with pytest.raises(ValueError, match="accel"):
        DECODERS["shimmer3"].decoder(accel="XY")


def test_a_pause_is_no_damage_for_long():
    early, late = [[imu_packet(start + 640 * k) for k in range(4)] for start in (0, 640 * 500)]
    decoder = DECODERS["shimmer3"].decoder()
    found = [r for p in (imu_inquiry(), *early, *late) for r in decoder.decode(p)]
    assert len(found) == 8


def vicon(frame, *objects):
    items = (struct.pack("<BH24s6d", 0, 72, name, *numbers) for name, numbers in objects)
    return struct.pack("<IB", frame, len(objects)) + b"".join(items)


def test_objects_of_a_vicon_tracker():
    sent = vicon(
        7, (b"seat", (100, -200, 1500, 0.1, 0.2, 0.3)), (b"hidden", (0,) * 6), (b"handle", (1, 2, 3, 0, 0, 0))
    )
    seat, handle = readings("vicon", sent + bytes(512 - len(sent)))
    assert (seat.device, seat.count, seat.clock_s) == ("seat", 7, None)
    assert seat.values == {"position_m": (0.1, -0.2, 1.5), "rotation_xyz_rad": (0.1, 0.2, 0.3)}
    assert handle.device == "handle"


def test_damaged_packets_of_a_vicon_tracker_are_counted():
    sent = vicon(7, (b"seat", (100, -200, 1500, 0.1, 0.2, 0.3)))
    nan = vicon(7, (b"seat", (100, math.nan, 1500, 0.1, 0.2, 0.3)))
    assert (
        damaged(
            "vicon", b"", sent[:-1], sent[:20], nan, sent[:6] + b"\x40" + sent[7:], b"\0\0\0\0\1\1\xff\xff"
        )
        == 6
    )
