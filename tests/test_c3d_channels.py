"""Analogue channels of C3D files: written here with ezc3d, and those of OpenSim's walking trial."""

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.devices.c3d import find_c3d, read_c3d
from oarlock.formats.listing import listed
from oarlock.recording.streams import ImuStream, ScalarStream
from refusals import assert_refused

ezc3d = pytest.importorskip("ezc3d", reason="NOT RUN: the extra oarlock[c3d] is not installed")

# No trial with inertial channels may be shipped: labels and units as Vicon Nexus and Delsys' software write them.
CHANNELS = [
    *((f"{word}{axis}1", unit) for word, unit in (("ACC", "g"), ("GYRO", "deg/s")) for axis in "XYZ"),
    *((f"L_TA: ACC.{axis}", "mm/s^2") for axis in "XYZ"),
    *((f"M{axis}1", "Nmm") for axis in "xyz"),
    ("EMG1", "V"),
]


def c3d_file(file, channels=CHANNELS, frames=4, per_frame=5):
    """A file with float samples; returns them (T, channels) as single precision stores them."""
    content = ezc3d.c3d()
    samples = np.random.default_rng(1).uniform(-2, 2, (frames * per_frame, len(channels))).astype(np.float32)
    content["parameters"]["POINT"]["RATE"]["value"] = [100]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["A"]
    content["parameters"]["ANALOG"]["RATE"]["value"] = [100 * per_frame]
    content["parameters"]["ANALOG"]["LABELS"]["value"] = [label for label, _ in channels]
    content["parameters"]["ANALOG"]["UNITS"]["value"] = [unit for _, unit in channels]
    content["data"]["points"] = np.ones((4, 1, frames))
    content["data"]["analogs"] = samples.T[None].astype(np.float64)
    content.write(str(file))
    return samples.astype(np.float64)


def test_inertial_units_by_label_and_unit(tmp_path):
    samples = c3d_file(tmp_path / "trial.c3d")
    recording = read_c3d(tmp_path / "trial.c3d")
    assert recording.names == ("imu_1", "l_ta", "Mx1", "My1", "Mz1", "EMG1")
    unit = recording["imu_1"]
    assert isinstance(unit, ImuStream)
    assert unit.accel_m_s2.tolist() == (samples[:, :3] * 9.80665).tolist()
    assert unit.gyro_rad_s.tolist() == (samples[:, 3:6] * np.pi / 180.0).tolist()
    assert recording["l_ta"].accel_m_s2.tolist() == (samples[:, 6:9] / 1000.0).tolist()
    assert recording["EMG1"].value.tolist() == samples[:, 12].tolist()
    assert unit.time_s.tolist() == (np.arange(20) / 500.0).tolist()
    assert recording.meta["source"]["units"]["Mx1"] == "Nmm"
    assert recording.meta["source"]["notes"] == []


def test_without_units_channels_stay_plain(tmp_path):
    c3d_file(tmp_path / "trial.c3d", [("ACCX", ""), ("ACCY", ""), ("ACCZ", ""), ("ACCZ", "")])
    recording = read_c3d(tmp_path / "trial.c3d")
    assert recording.names == ("ACCX", "ACCY", "ACCZ", "ACCZ_2")
    assert "no unit of measurement" in recording.meta["source"]["notes"][0]


def test_a_walking_trial_reads_as_ezc3d_reads_it():
    file = local_folder("data/opensim_core/OpenSim/Tests/shared") / "walking2.c3d"
    recording = read_c3d(file)
    theirs = ezc3d.c3d(str(file))
    assert list(recording.names) == theirs["parameters"]["ANALOG"]["LABELS"]["value"]
    for stream, values in zip(recording, theirs["data"]["analogs"][0], strict=True):
        assert isinstance(stream, ScalarStream)
        assert stream.value.tolist() == values.tolist()
        assert stream.rate_hz == pytest.approx(2000.0)
    assert "No inertial unit was found" in recording.meta["source"]["notes"][0]


def test_found_by_content(tmp_path):
    c3d_file(tmp_path / "trial.c3d")
    (tmp_path / "other.c3d").write_bytes(b"\x02\x00")
    assert [found.path.name for found in find_c3d(listed(tmp_path))] == ["trial.c3d"]


def test_what_is_refused(tmp_path):
    file = tmp_path / "trial.c3d"
    c3d_file(file, [], per_frame=1)
    assert_refused(lambda: read_c3d(file), "no analogue channels")
    c3d_file(file)
    whole = file.read_bytes()
    file.write_bytes(whole[:-512])
    assert_refused(lambda: read_c3d(file), "cut off")
    file.write_bytes(b"")
    assert_refused(lambda: read_c3d(file), "trial.c3d", "is not a C3D file")
    assert_refused(lambda: read_c3d(tmp_path / "nowhere.c3d"), "cannot be read")
