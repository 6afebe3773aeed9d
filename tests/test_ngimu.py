"""NGIMU: folders made here as the vendor's software writes them; no recording of it may be shipped."""

import csv
import math

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.devices.ngimu import find_ngimu, read_ngimu, read_ngimu_orientations
from oarlock.formats.listing import listed
from refusals import assert_refused

# NgimuApi/Data/SensorsData.cs and QuaternionData.cs; numbers with up to seven digits, times with nine decimals.
SENSORS = (
    "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),"
    "Accelerometer Z (g),Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT),Barometer (hPa)\n"
)
ROWS = (
    "0.000000000,16.5,-41.02662,15.62016,-0.7678422,0.1590301,0.5777743,13.87349,-26.15478,-29.08943,1000.447\n"
    "0.017339706,11.46466,-37.51688,14.39691,-0.7414287,0.1411861,0.5925011,12.39709,-26.53741,-29.0774,1000.448\n"
    "0.037157536,11.83206,-29.9528,0.0009917939,-0.7388422,0.1173546,0.5986394,12.39709,-26.53741,-29.07,1000.448\n"
)
QUATERNION = "Time (s),W,X,Y,Z\n0.000000000,0.5,0.5,-0.5,0.5\n0.017339706,1,0,0,0\n"
DEVICE = (
    "<Device>\n"
    '  <DeviceInformation DeviceName="{}" SerialNumber="{}" FirmwareVersion="v1.14" />\n'
    '  <TimeStamps First="2020-09-11 16:30:17.015" Last="2020-09-11 16:31:03.810" TimeSpan="00:00:46.795" />\n'
    "</Device>"
)


def unit(session, label, serial, sensors=SENSORS + ROWS, quaternion=QUATERNION):
    folder = session / f"{label} - {serial}"
    folder.mkdir(parents=True)
    (folder / "sensors.csv").write_bytes(sensors.encode())
    (folder / "quaternion.csv").write_bytes(quaternion.encode())
    (folder / "Device.xml").write_text(DEVICE.format(label, serial), encoding="utf-8")
    return folder


def test_a_session_reads_as_its_csv(tmp_path):
    folder = unit(tmp_path, "Left Arm", "00383454")
    unit(tmp_path, "Trunk", "00383455")
    recording = read_ngimu(tmp_path)
    assert recording.names == ("left_arm", "trunk")
    rows = list(csv.reader((folder / "sensors.csv").read_text(encoding="utf-8").splitlines()))[1:]
    cells = np.array([[float(cell) for cell in row] for row in rows])
    arm = recording["left_arm"]
    assert arm.time_s.tolist() == cells[:, 0].tolist()
    assert arm.gyro_rad_s.tolist() == (cells[:, 1:4] * math.pi / 180.0).tolist()
    assert arm.accel_m_s2.tolist() == (cells[:, 4:7] * 9.80665).tolist()
    assert arm.mag_ut.tolist() == cells[:, 7:10].tolist()
    assert recording.meta["source"]["units"]["trunk"]["serial"] == "00383455"
    assert "within 0 ms" in recording.meta["clock"]["found"][0]


def test_orientations_are_inverted(tmp_path):
    unit(tmp_path, "Arm", "1")
    (quat,) = read_ngimu_orientations(tmp_path).values()
    assert quat.time_s.tolist() == [0.0, 0.017339706]
    assert quat.quat_wxyz.tolist() == [[0.5, -0.5, 0.5, -0.5], [1.0, 0.0, 0.0, 0.0]]


def test_the_inverse_of_the_vendors_orientation_takes_gravity_to_z():
    """The convention, on a recording of three units that another program put into one table."""
    file = local_folder("data/opensimrt_upper_limb_ngimu") / "ngimu_data.csv"
    names, *rows = list(csv.reader(file.read_text(encoding="utf-8").splitlines()[4:]))
    cells = np.array([[float(cell) for cell in row] for row in rows])
    for label in ("thorax", "humerus", "radius"):
        quat = cells[:, [names.index(f"{label}_q{k}") for k in (1, 2, 3, 4)]]
        accel = cells[:, [names.index(f"{label}_a{axis}") for axis in "xyz"]]
        axis = -quat[:, 1:]
        up = np.median(accel + 2 * np.cross(axis, np.cross(axis, accel) + quat[:, :1] * accel), axis=0)
        # arms move slowly: the median acceleration is gravity up to the accelerometer's 2 %
        assert up == pytest.approx([0.0, 0.0, 1.0], abs=0.03)


def test_names_repeat_and_files_may_be_missing(tmp_path):
    unit(tmp_path, "NGIMU", "00383454")
    (unit(tmp_path, "NGIMU", "0038AABB") / "Device.xml").unlink()
    recording = read_ngimu(tmp_path)
    assert recording.names == ("ngimu_00383454", "ngimu_0038aabb")
    assert read_ngimu(tmp_path / "NGIMU - 0038AABB").names == ("ngimu",)


def test_found_by_content(tmp_path):
    folder = unit(tmp_path / "LOG_0000", "NGIMU", "00383454", SENSORS.replace("\n", "\r\n") + ROWS)
    unit(tmp_path / "LOG_0001", "NGIMU", "00383454")
    assert [found.name for found in find_ngimu(listed(tmp_path))] == ["LOG_0000", "LOG_0001"]
    (one,) = find_ngimu(listed(folder))
    assert (one.path, len(one.files)) == (folder, 3)


def test_units_without_a_common_time(tmp_path):
    unit(tmp_path, "A", "1")
    late = "".join(
        f"{float(row.split(',')[0]) + 900:.9f},{row.partition(',')[2]}\n" for row in ROWS.splitlines()
    )
    unit(tmp_path, "B", "2", SENSORS + late)
    assert_refused(lambda: read_ngimu(tmp_path), '"b" starts 900.0 s after "a" ends')


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ("sensors.csv", "is empty")),
        (SENSORS, ("no rows of data",)),
        (
            SENSORS.replace("Gyroscope X (deg/s)", "Gyroscope X (rad/s)") + ROWS,
            ("no column", "Gyroscope X (deg/s)"),
        ),
        (SENSORS + ROWS[:-40], (":4", "cut off")),
        (SENSORS + ROWS + ROWS, ("row 4", "Time (s)")),
        (SENSORS + ROWS.replace("16.5", "sixteen"), (":2", "sixteen")),
        (SENSORS + ROWS.replace("-0.7678422", "1e308"), ("arm", "accel_m_s2")),
    ],
)
def test_damaged_tables_are_named(content, words, tmp_path):
    folder = unit(tmp_path, "Arm", "1")
    (folder / "sensors.csv").write_text(content, encoding="utf-8")
    assert_refused(lambda: read_ngimu(tmp_path), *words)


def test_what_is_no_recording_is_refused(tmp_path):
    assert_refused(lambda: read_ngimu(tmp_path), "no NGIMU recording")
    assert_refused(lambda: read_ngimu(tmp_path / "nowhere"), "is no folder")
    (unit(tmp_path, "Arm", "1") / "Device.xml").write_text("<Device", encoding="utf-8")
    assert_refused(lambda: read_ngimu(tmp_path), "Device.xml", "is not XML")


def test_marks_of_other_systems(tmp_path):
    unit(tmp_path, "Arm", "1", "\ufeff" + (SENSORS + ROWS).replace("\n", "\r\n"))
    assert len(read_ngimu(tmp_path)["arm"]) == 3
