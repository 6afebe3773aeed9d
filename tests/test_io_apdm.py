import os
from pathlib import Path

import numpy as np
import pytest

from oarlock.formats.devices.apdm import read_apdm, read_apdm_orientations
from refusals import assert_refused

PENDULUM = Path(__file__).parents[1] / "examples/pendulum/imuData01.csv"
# Vendor and accelerometer find the vertical on their own; at rest they agree to its bias, 0.2 m/s2 or 1.2 deg.
VERTICAL_M_S2 = 0.2

FORMAT_7 = """Format=7,5718,,,Lower Back,,,,,,,,,,,5778,,,Right Ankle,,,,,,,,,,
Time,{0},{0}
,{1},{1}
1550879504438281,{2},{2}
1550879504446093,{2},{2}
1550879504453906,{2},{2}
""".format(
    "Accelerometer,,,Gyroscope,,,Magnetometer,,,Barometer,Orientation,,,",
    "X,Y,Z,X,Y,Z,X,Y,Z,,S,X,Y,Z",
    "-9.98,-2.45,0.51,-0.92,-0.08,-0.05,9.92,12.34,-7.77,4636858284341460992.0,0.5,-0.5,0.5,-0.5",
)


def rotated(quat_wxyz, vector):
    w, axis = quat_wxyz[0], quat_wxyz[1:]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)


def refused(file, *words):
    assert_refused(lambda: read_apdm(file), *words)


def edited(tmp_path, old, new):
    text = PENDULUM.read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "export.csv"
    file.write_text(text.replace(old, new, 1))
    return file


def test_pendulum():
    recording = read_apdm(PENDULUM)
    assert recording.names == ("static", "upper", "middle", "lower")
    upper = recording["upper"]
    assert upper.gyro_rad_s.shape == upper.accel_m_s2.shape == upper.mag_ut.shape == (1024, 3)
    assert upper.rate_hz == pytest.approx(128.0)
    assert upper.time_s[[0, -1]].tolist() == [0.007457625, 7.999645125]
    # the first and last row of the file, as printed there
    assert upper.accel_m_s2[0].tolist() == [-9.790337563, 0.061037015, -0.085451826]
    assert upper.gyro_rad_s[0].tolist() == [-0.005340739, 0.0, -0.003204443]
    assert recording["lower"].mag_ut[-1].tolist() == [3.15744493, -48.20581474, 19.04354858]
    assert recording.meta["source"]["test"] == "Pendulum Test 01"


@pytest.mark.parametrize("name", ["static", "upper", "middle", "lower"])
def test_vendor_orientation_takes_the_sensor_to_the_earth(name):
    quat_wxyz = read_apdm_orientations(PENDULUM)[name]
    stream = read_apdm(PENDULUM)[name]
    assert quat_wxyz.shape == (1024, 4)
    np.testing.assert_allclose(np.linalg.norm(quat_wxyz, axis=1), 1.0, atol=1e-6)
    up = rotated(quat_wxyz[0], stream.accel_m_s2[0])
    np.testing.assert_allclose(up, [0.0, 0.0, 9.81], atol=VERTICAL_M_S2)


def test_format_7(tmp_path):
    (tmp_path / "a.csv").write_text(FORMAT_7)
    recording = read_apdm(tmp_path / "a.csv")
    assert recording.names == ("lower_back", "right_ankle")
    assert recording["right_ankle"].time_s.tolist() == [0.0, 0.007812, 0.015625]
    assert recording["right_ankle"].gyro_rad_s[0].tolist() == [-0.92, -0.08, -0.05]
    assert recording["lower_back"].mag_ut[2].tolist() == [9.92, 12.34, -7.77]
    assert recording.meta["clock"] == {"kind": "utc", "zero": "2019-02-22T23:51:44.438281000Z"}
    assert read_apdm_orientations(tmp_path / "a.csv")["lower_back"][0].tolist() == [0.5, -0.5, 0.5, -0.5]


@pytest.mark.data
def test_format_7_as_the_maker_wrote_it():
    root = os.environ.get("OARLOCK_DATA")
    if not root:
        pytest.skip("OARLOCK_DATA is not set, so the maker's Format=7 file is not read")
    found = sorted(Path(root).glob("**/IMUData/APDM/apdm_format7.csv"))
    if not found:
        pytest.skip("OARLOCK_DATA holds no IMUData/APDM/apdm_format7.csv")
    recording = read_apdm(found[0])
    assert recording.names == ("lumbar", "right_ankle", "left_ankle", "left_foot", "chest", "right_foot")
    assert recording["right_foot"].mag_ut[0].tolist() == [-26.574296, 10.975066, 102.466499]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "m/s^2,m/s^2,m/s^2,rad/s",
            "m/s^2,m/s^2,m/s^2,deg/s",
            [":4", "Static/Angular Velocity/X", "deg/s", "rad/s"],
        ),
        ("uT", "a.u.", [":4", "Static/Magnetic Field/X", "a.u.", "uT"]),
        ("s,m/s^2", "s,g", [":4", "Static/Acceleration/X", '"g"', "m/s2"]),
        ("\ns,", "\nms,", [":4", '"Time"', '"ms"']),
        ("Upper/Acceleration/Y", "Upper/Other/Y", ['unit "Upper" has no column for accel_m_s2 Y']),
        ("9.804986382", "9;8", [":5", "Static/Acceleration/Z", "9;8"]),
        ("0.015270125,", "0.007457625,", [":6", "repeats", "0.007457625 s"]),
        ("0.015270125,", "0.001,", [":6", "earlier than"]),
        ("0.015270125,", ",", [":6", "time is missing"]),
        ("0.015270125,", "0.015270125,1,", [":6", "62 fields", "61"]),
        ("Test Name:", "Name:", [":1", "not an APDM export", "oarlock import csv"]),
        ("\nTime,", "\nClock,", [":3", '"Time"']),
    ],
)
def test_mistakes(tmp_path, old, new, words):
    refused(edited(tmp_path, old, new), "export.csv", *words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FORMAT_7.replace("Format=7", "Format=8"), '"Format=8" is not supported'),
        (FORMAT_7.replace("Right Ankle", "Lower back"), '"Lower Back" and "Lower back"'),
        ("\n".join(FORMAT_7.split("\n")[:3]) + "\n", "no rows of data"),
        ("\xff\xfe\x00\x01", "not an APDM export"),
        (None, "cannot be read"),
    ],
)
def test_other_formats(tmp_path, text, words):
    if text is not None:
        (tmp_path / "a.csv").write_text(text, encoding="latin-1")
    refused(tmp_path / "a.csv", words)


def test_missing_readings_become_nan(tmp_path):
    recording = read_apdm(edited(tmp_path, "9.804986382", ""))
    assert np.isnan(recording["static"].accel_m_s2[0, 2])
    assert recording["static"].missing_share == pytest.approx(1 / (9 * 1024))
