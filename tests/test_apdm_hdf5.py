"""APDM in HDF5: files made here in the layout of published readers; no file of the maker may be shipped."""

import numpy as np
import pytest

from oarlock.formats.devices.apdm import find_apdm, read_apdm, read_apdm_orientations
from oarlock.formats.listing import listed
from refusals import assert_refused

h5py = pytest.importorskip("h5py", reason="NOT RUN: the extra oarlock[hdf5] is not installed")

START_US = 1_550_879_504_438_281
ROWS = 5


def values(kind, number):
    """Single precision, as the files have it."""
    seed = int(number) + len(kind)
    return (
        np.random.default_rng(seed)
        .uniform(-2, 2, (ROWS, 4 if kind == "Orientation" else 3))
        .astype(np.float32)
    )


def hdf5_file(file, sensors=(("5718", "Lumbar"), ("5778", "Right Foot")), units=True):
    with h5py.File(file, "w") as content:
        content.attrs["FileFormatVersion"] = 5
        for shift_us, (number, label) in enumerate(sensors):
            group = content.create_group(f"Sensors/{number}")
            group.create_group("Configuration").attrs["Label 0"] = np.bytes_(label)
            group["Time"] = np.uint64(START_US + shift_us) + np.arange(ROWS, dtype=np.uint64) * np.uint64(
                7812
            )
            for kind, unit in (("Accelerometer", "m/s^2"), ("Gyroscope", "rad/s"), ("Magnetometer", "uT")):
                group[kind] = values(kind, number)
                if units:
                    group[kind].attrs["Units"] = np.bytes_(unit)
            group["Barometer"] = np.ones(ROWS)
            content[f"Processed/{number}/Orientation"] = values("Orientation", number)
    return file


def changed(tmp_path, change):
    with h5py.File(hdf5_file(tmp_path / "walk.h5"), "r+") as content:
        change(content)
    return tmp_path / "walk.h5"


def test_sensors_read_as_h5py_reads_them(tmp_path):
    recording = read_apdm(hdf5_file(tmp_path / "walk.h5"))
    assert recording.names == ("lumbar", "right_foot")
    lumbar = recording["lumbar"]
    assert lumbar.accel_m_s2.tolist() == values("Accelerometer", "5718").astype(float).tolist()
    assert lumbar.gyro_rad_s.tolist() == values("Gyroscope", "5718").astype(float).tolist()
    assert lumbar.mag_ut.tolist() == values("Magnetometer", "5718").astype(float).tolist()
    assert lumbar.time_s.tolist() == (np.arange(ROWS) * 7_812_000 / 1e9).tolist()
    assert recording["right_foot"].time_s[0] == 1e-6
    assert recording.epoch.startswith("2019-02-22T23:51:44.438281")
    assert recording.meta["source"]["sensors"] == {"lumbar": "5718", "right_foot": "5778"}
    quat = read_apdm_orientations(tmp_path / "walk.h5")["right_foot"]
    assert quat.tolist() == values("Orientation", "5778").astype(float).tolist()


def test_units_may_be_absent_and_labels_repeat(tmp_path):
    sensors = (("5718", "Foot"), ("5778", "Foot"))
    recording = read_apdm(hdf5_file(tmp_path / "walk.h5", sensors, units=False))
    assert recording.names == ("foot_5718", "foot_5778")


def test_found_by_content(tmp_path):
    hdf5_file(tmp_path / "walk.h5")
    with h5py.File(tmp_path / "other.h5", "w") as content:
        content["data"] = np.ones(3)
    assert [found.path.name for found in find_apdm(listed(tmp_path))] == ["walk.h5"]


def replace_rows(content):
    del content["Sensors/5718/Gyroscope"]
    content["Sensors/5718/Gyroscope"] = np.ones((ROWS - 1, 3))


def replace_time(content):
    del content["Sensors/5718/Time"]
    content["Sensors/5718/Time"] = np.arange(ROWS) / 100.0


def old_layout(content):
    del content["Sensors"]
    content["SI-000646/Calibrated/Gyroscopes"] = np.ones((ROWS, 3))


def other_unit(content):
    content["Sensors/5718/Gyroscope"].attrs["Units"] = np.bytes_("deg/s")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replace_rows, ("/Sensors/5718/Gyroscope", "expected 5 rows of 3")),
        (replace_time, ("/Sensors/5718/Time", "whole microseconds")),
        (old_layout, ("older layout", "Export it as CSV")),
        (other_unit, ("/Sensors/5718/Gyroscope", '"deg/s"', "rad/s")),
        (lambda content: content.pop("Sensors"), ("no file of APDM's",)),
    ],
)
def test_other_layouts_are_refused_by_name(change, words, tmp_path):
    file = changed(tmp_path, change)
    assert_refused(lambda: read_apdm(file), "walk.h5", *words)


def test_damaged_files_are_refused(tmp_path):
    file = hdf5_file(tmp_path / "walk.h5")
    whole = file.read_bytes()
    file.write_bytes(whole[:2000])
    assert_refused(lambda: read_apdm(file), "walk.h5", "is not a HDF5 file, or is damaged")
