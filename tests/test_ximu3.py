"""x-IMU3: CSV folders beside the values in them, and .ximu3 files, which are made here from the published protocol."""

import csv
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.devices.ximu3 import find_ximu3, read_ximu3, read_ximu3_orientations
from oarlock.formats.listing import listed
from refusals import assert_refused

SAMPLE = Path(__file__).parent / "data/ximu3"
FOOT = "Right Foot 64F619FB (UDP)"
PING = b'{"ping":{"interface":"USB","name":"Left Hand","sn":"0123ABCD"}}\n'
# The manual's and hand-made examples of messages.
INERTIAL = bytes.fromhex("C9 40420F0000000000 0000000000000000000000000000000000000000 0000803F 0A")
QUATERNION = bytes.fromhex("D1 40420F0000000000 0000803F 000000000000000000000000 0A")
STUFFED = bytes.fromhex(
    "C9 DBDC DBDC 000000000000 00002041 000020C0 00000000 00000000 000000BF D7B35D3F 0A".replace(" ", "")
)


def cells(file):
    with open(file, newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array([[float(cell) for cell in row] for row in rows])


def message(letter, time_us, *values):
    plain = bytes([ord(letter) + 0x80]) + struct.pack(f"<Q{len(values)}f", time_us, *values)
    return plain.replace(b"\xdb", b"\xdb\xdd").replace(b"\n", b"\xdb\xdc") + b"\n"


def log(tmp_path, *parts, name="log.ximu3"):
    file = tmp_path / name
    file.write_bytes(b"".join(parts))
    return file


def assert_reads_as_the_csv(folder, stream, orientation):
    _, inertial = cells(folder / "Inertial.csv")
    rows = np.searchsorted(stream.time_s, inertial[:, 0] / 1e6)
    assert stream.time_s[rows].tolist() == (inertial[:, 0] / 1e6).tolist()
    assert stream.gyro_rad_s[rows].tolist() == (inertial[:, 1:4] * math.pi / 180.0).tolist()
    assert stream.accel_m_s2[rows].tolist() == (inertial[:, 4:] * 9.80665).tolist()
    _, magnetic = cells(folder / "Magnetometer.csv")
    seen = ~np.isnan(stream.mag_ut[:, 0])
    assert stream.time_s[seen].tolist() == (magnetic[:, 0] / 1e6).tolist()
    factor = 50.0 / np.median(np.linalg.norm(magnetic[:, 1:], axis=1))
    assert stream.mag_ut[seen].tolist() == (magnetic[:, 1:] * factor).tolist()
    assert np.isfinite(stream.gyro_rad_s).all(axis=1).sum() == len(inertial)
    _, quaternion = cells(folder / "Quaternion.csv")
    assert orientation.time_s.tolist() == (quaternion[:, 0] / 1e6).tolist()
    assert orientation.quat_wxyz.tolist() == quaternion[:, 1:].tolist()


def test_folders_read_as_their_csv():
    recording, orientations = read_ximu3(SAMPLE), read_ximu3_orientations(SAMPLE)
    assert recording.names == tuple(orientations) == ("right_foot", "right_lower_leg")
    assert_reads_as_the_csv(SAMPLE / FOOT, recording["right_foot"], orientations["right_foot"])
    assert recording.meta["source"]["units"]["right_foot"] == {
        "device_name": "Right Foot",
        "serial": "64F619FB",
        "device_time": "2023-09-16 02:06:25",
    }
    assert "within 9 ms" in recording.meta["clock"]["found"][0]
    assert "arbitrary units" in recording.meta["source"]["notes"][0]


def test_the_whole_sample_reads_as_its_csv():
    folder = local_folder("data/xio_imumocap_lower_body/Examples/logged_lower_body")
    recording, orientations = read_ximu3(folder), read_ximu3_orientations(folder)
    assert len(recording) == 7
    for unit in sorted(folder.iterdir()):
        name = "_".join(unit.name.lower().split()[:-2])
        assert_reads_as_the_csv(unit, recording[name], orientations[name])


@pytest.mark.parametrize("name", ["right_foot", "right_lower_leg"])
def test_the_vendors_orientation_takes_the_sensor_to_the_earth(name):
    stream, quat = read_ximu3(SAMPLE)[name], read_ximu3_orientations(SAMPLE)[name].quat_wxyz[0]
    accel, axis = stream.accel_m_s2[np.isfinite(stream.accel_m_s2[:, 0])][0], quat[1:]
    up = accel + 2 * np.cross(axis, np.cross(axis, accel) + quat[0] * accel)
    # the unit stands still: up to the accelerometer's bias of some mg, gravity points along the earth's Z
    assert up == pytest.approx([0.0, 0.0, 9.8], abs=0.25)


def test_one_folder_is_one_unit_and_its_name_may_come_from_the_folder(tmp_path):
    assert read_ximu3(SAMPLE / FOOT).names == ("right_foot",)
    plain = tmp_path / "Right Foot 64F619FB (UDP)"
    plain.mkdir()
    (plain / "Inertial.csv").write_bytes((SAMPLE / FOOT / "Inertial.csv").read_bytes())
    assert read_ximu3(plain).names == ("right_foot",)
    assert read_ximu3(plain).meta["source"]["units"]["right_foot"]["serial"] == "64F619FB"


def test_what_the_software_of_other_systems_writes(tmp_path):
    text = (SAMPLE / FOOT / "Inertial.csv").read_text(encoding="utf-8")
    (tmp_path / "Inertial.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    (stream,) = read_ximu3(tmp_path)
    assert len(stream) == 25


def test_found_by_content():
    (found,) = find_ximu3(listed(SAMPLE.parent / "ximu3"))
    assert (found.path, found.name, found.about) == (SAMPLE, "ximu3", "x-io x-IMU3, 2 units, CSV")
    assert len(found.files) == 8
    (one,) = find_ximu3(listed(SAMPLE / FOOT))
    assert one.path == SAMPLE / FOOT
    assert read_ximu3(one.path).names == ("right_foot",)
    assert find_ximu3(listed(Path(__file__))) == []


def test_messages_of_the_manual(tmp_path):
    file = log(tmp_path, PING, STUFFED, INERTIAL, QUATERNION)
    recording = read_ximu3(file)
    (stream,) = recording
    assert stream.name == "left_hand"
    assert stream.time_s.tolist() == [2570e-6, 1.0]
    assert stream.gyro_rad_s[0].tolist() == [10.0 * math.pi / 180.0, -2.5 * math.pi / 180.0, 0.0]
    assert stream.accel_m_s2[0].tolist() == [0.0, -0.5 * 9.80665, float(np.float32(0.8660254)) * 9.80665]
    assert stream.accel_m_s2[1].tolist() == [0.0, 0.0, 9.80665]
    orientation = read_ximu3_orientations(file)["left_hand"]
    assert (orientation.time_s.tolist(), orientation.quat_wxyz.tolist()) == ([1.0], [[1.0, 0.0, 0.0, 0.0]])


def test_binary_and_text_messages_of_random_numbers(tmp_path):
    random = np.random.default_rng(1)
    # stamps and mantissas full of 0x0A and 0xDB, so that escapes meet each other
    stamps = np.cumsum(random.choice([0x0A, 0xDB, 0x0ADB, 0xDBDC, 0xDBDD, 0x0A0A], 300)).tolist()
    values = random.choice([0x0A, 0xDB, 0xDC, 0xDD, 0x3F, 0x41], (300, 24)).astype(np.uint8).view("<f4")
    sent = [message("I", t, *v.tolist()) for t, v in zip(stamps, values, strict=True)]
    assert all(one.count(b"\n") == 1 for one in sent)
    (stream,) = read_ximu3(log(tmp_path, PING, *sent))
    assert stream.time_s.tolist() == [t / 1e6 for t in stamps]
    assert stream.gyro_rad_s.tolist() == (values[:, :3].astype(float) * math.pi / 180.0).tolist()
    assert stream.accel_m_s2.tolist() == (values[:, 3:].astype(float) * 9.80665).tolist()
    text = [f"I,{t},1.5,-2.25,0.5,0.0001,0.5,1.0000\n".encode() for t in stamps]
    (plain,) = read_ximu3(log(tmp_path, PING, *text))
    assert plain.time_s.tolist() == stream.time_s.tolist()
    assert plain.accel_m_s2[0].tolist() == [0.0001 * 9.80665, 0.5 * 9.80665, 9.80665]


def test_other_messages_are_left_out_and_damaged_ones_are_counted(tmp_path):
    others = [
        message("T", 5, 25.0),
        b"N,7,Button pressed.\n",
        b'{"note":"\xff"}\n',
        message("H", 9, 0.0, 0.0, 1.0),
    ]
    broken = [INERTIAL[:-3] + b"\n", b"\xc9\xdb\x00\n", b"I,12,1,2\n", b"\x00\x01\n"]
    recording = read_ximu3(log(tmp_path, PING, INERTIAL, *others, *broken, STUFFED[:9]))
    assert len(recording["left_hand"]) == 1
    assert set(recording.meta["source"]["notes"]) == {
        "log.ximu3: is cut off in its last message.",
        "Left Hand: 5 messages are damaged and were left out.",
    }


def test_a_multiplexed_stream_has_one_unit_a_channel(tmp_path):
    other = PING.replace(b"Left", b"Right").replace(b"0123", b"4567")
    parts = [b"^\x00" + PING, b"^\x01" + other, b"^\x01" + INERTIAL, b"^\x00" + INERTIAL]
    assert read_ximu3(log(tmp_path, *parts)).names == ("left_hand", "right_hand")


def test_late_and_repeated_messages(tmp_path):
    a, b, c = (message("I", t, 0.0, 0.0, float(t), 0.0, 0.0, 1.0) for t in (1000, 3500, 6000))
    (stream,) = recording = read_ximu3(log(tmp_path, PING, a, c, b, b))
    assert stream.time_s.tolist() == [0.001, 0.0035, 0.006]
    assert "2 Inertial messages came late" in recording.meta["source"]["notes"][0]
    assert "1 came twice" in recording.meta["source"]["notes"][0]
    differs = message("I", 3500, 9.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert_refused(lambda: read_ximu3(log(tmp_path, PING, a, b, differs)), "different Inertial messages")
    restarted = [message("I", t, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) for t in (5_000_000, 1_000)]
    assert_refused(lambda: read_ximu3(log(tmp_path, PING, *restarted)), "go back by 5.0 s", "started again")


def test_units_need_a_common_time(tmp_path):
    def unit(name, start_us):
        rows = [message("I", start_us + 2500 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) for k in range(2000)]
        log(
            tmp_path,
            PING.replace(b"Left Hand", name).replace(b"0123", name[:4]),
            *rows,
            name=f"{name.decode()}.ximu3",
        )

    unit(b"Hand", 0)
    unit(b"Foot", 2_000_000)
    assert "are 2.0 s apart" in read_ximu3(tmp_path).meta["clock"]["found"][0]
    (both,) = find_ximu3(listed(tmp_path))
    assert both.path == tmp_path
    unit(b"Foot", 60_000_000)
    assert_refused(lambda: read_ximu3(tmp_path), '"foot" starts 55.0 s after "hand" ends')


def test_files_of_one_unit_are_several_recordings(tmp_path):
    for name in ("0000.ximu3", "0001.ximu3"):
        log(tmp_path, PING, INERTIAL, name=name)
    assert [found.path.name for found in find_ximu3(listed(tmp_path))] == ["0000.ximu3", "0001.ximu3"]
    assert_refused(lambda: read_ximu3(tmp_path), "both are of a unit", "0001.ximu3")


def test_orientations_that_point_down_are_refused(tmp_path):
    file = log(tmp_path, PING, b'{"ahrs_axes_convention":2}\n', QUATERNION, INERTIAL)
    assert_refused(lambda: read_ximu3_orientations(file), "north-east-down")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("Inertial.csv", "", ("Inertial.csv", "is empty")),
        ("Inertial.csv", "Timestamp (us),X\n1,2\n", ('no column "Gyroscope X (deg/s)"',)),
        ("Magnetometer.csv", "Timestamp (us),X (a.u.),Y (a.u.),Z (a.u.)\n1,2,3\n", (":2", "has 4")),
        (
            "Magnetometer.csv",
            "Timestamp (us),X (a.u.),Y (a.u.),Z (a.u.)\n1.5,2,3,4\n",
            ("whole microseconds",),
        ),
        ("Magnetometer.csv", "Timestamp (us),X (a.u.),Y (a.u.),Z (a.u.)\n", ("no rows of data",)),
        ("Command.json", "[{", ("Command.json", "is not JSON")),
        ("Command.json", '{"ping":1}', ("Command.json", "expected a list")),
    ],
)
def test_damaged_files_are_named(name, content, words, tmp_path):
    for file in (SAMPLE / FOOT).iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / name).write_text(content, encoding="utf-8")
    assert_refused(lambda: read_ximu3(tmp_path), *words)


def test_what_is_no_recording_is_refused(tmp_path):
    assert_refused(lambda: read_ximu3(tmp_path), "is no x-IMU3 recording")
    assert_refused(lambda: read_ximu3(tmp_path / "nowhere"), "does not exist")
    assert_refused(lambda: read_ximu3(log(tmp_path, b"")), "has no message of an x-IMU3")
    assert_refused(lambda: read_ximu3(log(tmp_path, PING)), "no unit has inertial")
