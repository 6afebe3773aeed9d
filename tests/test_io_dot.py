"""CSV files of Movella DOT, made by hand: as the log writer of the maker's app and the user manual say."""

import math

import numpy as np
import pytest

from oarlock.formats.devices.dot import find_dot, read_dot
from oarlock.formats.devices.mtmanager import find_mtmanager
from oarlock.formats.listing import listed
from oarlock.recording.packets import missing_packets
from oarlock.recording.streams import OrientationStream
from refusals import assert_refused

HEAD = """sep=,
DeviceTag:,{tag},,,,,,,,,,,,,,,,,
FirmwareVersion:,2.0.0,,,,,,,,,,,,,,,,,
AppVersion:,2022.6.0,,,,,,,,,,,,,,,,,
SyncStatus:,{sync},,,,,,,,,,,,,,,,,
OutputRate:,60Hz,,,,,,,,,,,,,,,,,
FilterProfile:,General,,,,,,,,,,,,,,,,,
Measurement Mode:,{mode},,,,,,,,,,,,,,,,,
StartTime:,2025-07-11 20:06:00.086 +0100,,,,,,,,,,,,,,,,,
Movella Technologies B. V. 2005-2025,,,,,,,,,,,,,,,,,,,

"""
RATES = """PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Mag_X,Mag_Y,Mag_Z
1, 4294950629, 0.10000000149011612, -0.25, 9.8125, 90.0, -1.5, 0.0625, 0.5, -0.25, 0.75
2, 0, 0.125, -0.5, 9.75, 45.0, 2.5E-4, -180.0, 0.5, -0.25, 0.75
3, 16667, 0.125, -0.5, 9.75, 45.0, 1.0, 0.5, 0.5, -0.25, 0.75
6, 66668, 0.25, NaN, 9.5, 0.0, 0.0, 0.0, 0.5, -0.25, 0.75
"""
RECORDED = """PacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Status,
7, 2268972329, 90.0, 0.0, 0.0, -0.022103, -0.080439, 0.119097, 0,
8, 2268988996, 0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 9,
9, 2269005663, 0.0, 0.0, -90.0, 0.0, 0.0, 0.0, 513,
"""


def written(
    folder, name="1_20250711_200600_086.csv", body=RATES, tag="1", sync="Synced", mode="Rate quantities"
):
    text = HEAD.format(tag=tag, sync=sync, mode=mode) + body
    (folder / name).write_bytes(text.encode("utf-8"))
    return folder / name


def refused(file, *words, **options):
    assert_refused(lambda: read_dot(file, **options), *words)


def test_rate_quantities(tmp_path):
    recording = read_dot(written(tmp_path, tag="Right Arm"))
    stream = recording["right_arm"]
    assert stream.time_s.tolist() == [
        4294950629 / 1e6,
        2**32 / 1e6,
        (2**32 + 16667) / 1e6,
        (2**32 + 66668) / 1e6,
    ]
    assert stream.gyro_rad_s[0].tolist() == [
        90.0 * math.pi / 180.0,
        -1.5 * math.pi / 180.0,
        0.0625 * math.pi / 180.0,
    ]
    assert stream.accel_m_s2[0].tolist() == [0.10000000149011612, -0.25, 9.8125]
    assert np.isnan(stream.accel_m_s2[3, 1])
    factor = recording.meta["mag_scale"]["right_arm"]
    assert stream.mag_ut[0].tolist() == [0.5 * factor, -0.25 * factor, 0.75 * factor]
    assert missing_packets(recording, stream) == 2
    assert recording.meta["clock"] == {"kind": "relative", "from": "SampleTimeFine"}
    assert recording.meta["source"] == {
        "format": "dot",
        "files": ["1_20250711_200600_086.csv"],
        "trial": "1_20250711_200600_086",
        "units": {
            "right_arm": {
                "device": "Right Arm",
                "firmware": "2.0.0",
                "software": "2022.6.0",
                "sync": "Synced",
                "rate": "60Hz",
                "filter": "General",
                "mode": "Rate quantities",
                "start": "2025-07-11 20:06:00.086 +0100",
            }
        },
        "left_out": [],
        "notes": recording.meta["source"]["notes"],
    }


def test_angles_are_yaw_pitch_roll_about_z_y_x(tmp_path):
    recording = read_dot(written(tmp_path, body=RECORDED))
    (stream,) = recording
    assert isinstance(stream, OrientationStream) and stream.name == "1"
    half = math.sqrt(0.5)
    np.testing.assert_allclose(
        stream.quat_wxyz, [[half, half, 0, 0], [half, 0, half, 0], [half, 0, 0, -half]], atol=1e-12
    )
    assert recording.meta["source"]["units"]["1"]["out_of_range"] == {"accel_x": 2, "gyro_x": 1}
    assert "accel_x in 2 rows, gyro_x in 1 row" in recording.meta["source"]["notes"][0]
    assert recording.meta["source"]["left_out"] == ["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z"]


def test_quaternions_before_angles(tmp_path):
    body = RATES.replace("Mag_X,Mag_Y,Mag_Z", "Quat_W,Quat_X,Quat_Y,Quat_Z").replace(
        "0.5, -0.25, 0.75", "0.5, -0.5, 0.5, 0.5"
    )
    recording = read_dot(written(tmp_path, body=body), orientations=True)
    assert recording.names == ("1", "1_orientation")
    assert recording["1_orientation"].quat_wxyz[0].tolist() == [0.5, -0.5, 0.5, 0.5]
    assert read_dot(tmp_path).names == ("1",)


def test_synchronised_units_are_one_trial(tmp_path):
    written(tmp_path, "1_20250711_200600_086.csv", tag="1")
    written(
        tmp_path, "2_20250711_200600_112.csv", tag="2", body=RATES.replace("1, 4294950629", "1, 4294950640")
    )
    written(tmp_path, "1_20250711_201500_001.csv", tag="1")
    written(tmp_path, "3_20250711_200600_115.csv", tag="3", sync="Un-synced")
    found = find_dot(listed(tmp_path))
    assert [(one.name, len(one.files)) for one in found] == [
        ("20250711_200600_086", 2),
        ("1_20250711_201500_001", 1),
        ("3_20250711_200600_115", 1),
    ]
    recording = read_dot(found[0].path, **found[0].options)
    assert recording.names == ("1", "2")
    assert recording["2"].time_s[0] - recording["1"].time_s[0] == pytest.approx(11e-6, abs=1e-9)
    refused(tmp_path, "has 3 trials", "20250711_200600_086")


def test_a_file_that_two_makers_could_have_written_is_found_as_both(tmp_path):
    (tmp_path / "bare.csv").write_text(RATES, encoding="utf-8")
    found = [*find_dot(listed(tmp_path)), *find_mtmanager(listed(tmp_path))]
    assert [one.format for one in found] == ["dot", "mtmanager"]
    written(tmp_path, "bare.csv")
    assert not find_mtmanager(listed(tmp_path)) and find_dot(listed(tmp_path))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n", "\r\n"),
        ("sep=,", "\ufeffsep=,"),
        ("PacketCounter", "© Movella Technologies B. V. 2005-2025\n\nPacketCounter"),
        ("Mag_Z\n", "Mag_Z,\n"),
        (", ", ","),
    ],
)
def test_forms_of_one_file(tmp_path, old, new):
    plain = read_dot(written(tmp_path))["1"]
    text = (tmp_path / "1_20250711_200600_086.csv").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "again.csv").write_bytes(text.replace(old, new).encode("utf-8"))
    np.testing.assert_array_equal(read_dot(tmp_path / "again.csv")["1"].gyro_rad_s, plain.gyro_rad_s)


def test_decimal_commas_and_semicolons(tmp_path):
    plain = read_dot(written(tmp_path))["1"]
    text = (tmp_path / "1_20250711_200600_086.csv").read_text(encoding="utf-8")
    head, body = text.replace(", ", ",").split("PacketCounter")
    (tmp_path / "again.csv").write_text(
        (head + "PacketCounter" + body).replace(",", ";").replace(".", ","), encoding="utf-8"
    )
    np.testing.assert_array_equal(read_dot(tmp_path / "again.csv")["1"].accel_m_s2, plain.accel_m_s2)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("9.8125", "9.8x", [":13", '"Acc_Z"', "9.8x"]),
        ("\n2, 0,", "\n1, 0,", [":14", '"PacketCounter"', "1 after 1"]),
        (" 16667,", " 0,", [":15", '"SampleTimeFine"', "repeats"]),
        (" 16667,", " ,", [":15", '"SampleTimeFine"', "time is missing"]),
        (", 0.75\n2", "\n2", [":13", "10 fields", "11"]),
        ("Gyr_Y", "Gyr_U", ['none "Gyr_Y"']),
        ("PacketCounter", "Counter", ["not a CSV file of Movella DOT"]),
    ],
)
def test_mistakes(tmp_path, old, new, words):
    refused(written(tmp_path, body=RATES.replace(old, new, 1)), "200600_086.csv", *words)


@pytest.mark.parametrize("status", ["-1", "65536", "0.5"])
def test_flags_that_are_none(tmp_path, status):
    file = written(tmp_path, body=RECORDED.replace(" 9,\n", f" {status},\n"))
    refused(file, ":14", '"Status"', status)


def test_files_without_readings(tmp_path):
    refused(written(tmp_path, body=RECORDED.replace("Euler", "Other")), ":12", "Free acceleration")
    refused(written(tmp_path, body=RATES.split("\n")[0] + "\n"), "no rows of data")
