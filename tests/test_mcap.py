"""MCAP: files written here with the library's writer; messages encoded here as ROS 2 encodes them."""

import struct

import numpy as np
import pytest

from oarlock.formats.devices.mcap import find_mcap, read_mcap
from oarlock.formats.listing import listed
from refusals import assert_refused

pytest.importorskip("mcap", reason="NOT RUN: the extra oarlock[mcap] is not installed")
from mcap.writer import Writer

START_NS = 1_800_000_000_125_000_000
GYRO, ACCEL, FIELD = (0.1, -0.2, 0.3), (0.5, 0.25, 9.81), (2.1e-5, 0.0, -4e-5)


def cdr(stamp_ns, frame, *groups, order="<"):
    """A header and groups of doubles, aligned as CDR wants it."""
    text = frame.encode() + b"\0"
    head = struct.pack(f"{order}iII", stamp_ns // 10**9, stamp_ns % 10**9, len(text)) + text
    head += b"\0" * (-len(head) % 8)
    values = [value for group in groups for value in group]
    return bytes([0, order == "<", 0, 0]) + head + struct.pack(f"{order}{len(values)}d", *values)


def imu(stamp_ns, frame="wrist", gyro=GYRO, accel=ACCEL, gyro_known=0.0, order="<"):
    nine = (0.0,) * 9
    return cdr(stamp_ns, frame, (0, 0, 0, 1), nine, gyro, (gyro_known, *nine[1:]), accel, nine, order=order)


def written(tmp_path, *topics):
    """A file with messages (topic, schema, [(log time, body)])."""
    file = tmp_path / "bag.mcap"
    with open(file, "wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        for topic, schema, messages in topics:
            number = writer.register_schema(schema, "ros2msg", b"")
            channel = writer.register_channel(topic, "cdr", number)
            for log_ns, body in messages:
                writer.add_message(channel, log_ns, body, log_ns)
        writer.finish()
    return file


def bag(tmp_path, **changed):
    readings = [(START_NS + 10**7 * k + 500, imu(START_NS + 10**7 * k, **changed)) for k in range(4)]
    fields = [
        (START_NS + 2 * 10**7 * k, cdr(START_NS + 2 * 10**7 * k, "wrist", FIELD, (0.0,) * 9))
        for k in range(2)
    ]
    return written(
        tmp_path,
        ("/left_wrist/imu", "sensor_msgs/msg/Imu", readings),
        ("/left_wrist/mag", "sensor_msgs/msg/MagneticField", fields),
        ("/camera", "sensor_msgs/msg/Image", [(START_NS, b"pixels")]),
    )


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("frame", ["wrist", "", "a", "longer_frame"])
def test_values(order, frame, tmp_path):
    body = [(START_NS, imu(START_NS, frame, order=order))]
    recording = read_mcap(written(tmp_path, ("/imu/data", "sensor_msgs/msg/Imu", body)))
    unit = recording["imu_data"]
    assert unit.gyro_rad_s.tolist() == [list(GYRO)]
    assert unit.accel_m_s2.tolist() == [list(ACCEL)]


def test_a_magnetometer_belongs_to_the_unit_of_its_frame(tmp_path):
    recording = read_mcap(bag(tmp_path))
    assert recording.names == ("left_wrist_imu",)
    unit = recording.streams[0]
    assert unit.time_s.tolist() == [0.0, 0.01, 0.02, 0.03]
    assert np.array_equal(unit.mag_ut[:, 0], [2.1e-5 * 1e6, np.nan, 2.1e-5 * 1e6, np.nan], equal_nan=True)
    assert recording.epoch.startswith("2027-01-15T08:00:00.125")
    assert recording.meta["source"]["notes"] == ["/camera (sensor_msgs/msg/Image cdr): was not imported."]


def test_magnetometers_without_a_unit_are_streams(tmp_path):
    body = [(START_NS, cdr(START_NS, "head", FIELD, (0.0,) * 9))]
    recording = read_mcap(written(tmp_path, ("/head/mag", "sensor_msgs/msg/MagneticField", body)))
    assert list(recording["head_mag"].values) == ["mag_ut"]


def test_what_is_not_measured_is_left_out(tmp_path):
    unit = read_mcap(bag(tmp_path, gyro_known=-1.0)).streams[0]
    assert list(unit.values) == ["accel_m_s2", "mag_ut"]


def test_the_recorders_stamps_where_headers_have_none(tmp_path):
    readings = [(START_NS + 10**7 * k, imu(0)) for k in range(3)]
    recording = read_mcap(written(tmp_path, ("/imu", "sensor_msgs/msg/Imu", readings)))
    assert recording["imu"].time_s.tolist() == [0.0, 0.01, 0.02]


def test_what_is_refused(tmp_path):
    def refused(messages, *words):
        file = written(tmp_path, ("/imu", "sensor_msgs/msg/Imu", messages))
        assert_refused(lambda: read_mcap(file), "bag.mcap", *words)

    refused([(1, imu(5)), (2, imu(5))], "message 2 of /imu", "not later")
    refused([(1, imu(5)), (2, imu(6, "foot"))], "2 frames", "foot")
    refused([(1, imu(5)[:-8])], "message 1 of /imu is damaged")
    refused([(1, b"{}")], "do not begin as CDR does")
    other = written(tmp_path, ("/camera", "sensor_msgs/msg/Image", [(1, b"pixels")]))
    assert_refused(lambda: read_mcap(other), "no messages sensor_msgs/msg/Imu", "/camera")
    whole = bag(tmp_path).read_bytes()
    for content in (b"", whole[:-40], whole[:30]):
        (tmp_path / "bag.mcap").write_bytes(content)
        assert_refused(lambda: read_mcap(tmp_path / "bag.mcap"), "bag.mcap", "is not a MCAP file")


def test_found_by_content(tmp_path):
    bag(tmp_path)
    assert [found.name for found in find_mcap(listed(tmp_path))] == ["bag"]
