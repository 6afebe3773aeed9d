"""Tables of orientations of OpenSim: a file of its own tests, read once more by plain splitting."""

from pathlib import Path

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.devices.sto import find_sto, read_sto
from oarlock.formats.listing import listed
from oarlock.model.rotation import matrix_from_quat
from oarlock.recording.streams import OrientationStream
from refusals import assert_refused

SAMPLE = Path(__file__).parent / "data/opensim/orientation_quats.sto"
ROUNDING = 1e-12


def independent(file):
    """Time stamps and quaternions by label, by splitting lines: no code of the package."""
    names, *rows = [line.split("\t") for line in file.read_text().split("endheader\n")[1].splitlines()]
    quat = {
        name: np.array([[float(part) for part in row[i].split(",")] for row in rows])
        for i, name in enumerate(names)
        if i
    }
    return np.array([float(row[0]) for row in rows]), quat


def edited(tmp_path, old, new):
    text = SAMPLE.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "turns.sto").write_bytes(text.replace(old, new, 1).encode("utf-8"))
    return tmp_path / "turns.sto"


def refused(file, *words, **options):
    assert_refused(lambda: read_sto(file, **options), *words)


def test_every_quaternion_to_the_last_bit():
    recording = read_sto(SAMPLE)
    time_s, quat = independent(SAMPLE)
    assert recording.names == tuple(quat) and recording.names[0] == "pelvis_imu"
    for stream in recording:
        assert isinstance(stream, OrientationStream)
        np.testing.assert_array_equal(stream.time_s, time_s)
        np.testing.assert_array_equal(stream.quat_wxyz, quat[stream.name])
    said = recording.meta["source"]["units"]["header"]
    assert said == {
        "DataRate": "100.000000",
        "DataType": "Quaternion",
        "version": "3",
        "OpenSimVersion": "4.2",
    }


def test_reference_whose_y_points_up():
    plain, turned = read_sto(SAMPLE), read_sto(SAMPLE, up="y")
    for stream in plain:
        up = matrix_from_quat(stream.quat_wxyz)[:, 1]
        np.testing.assert_allclose(matrix_from_quat(turned[stream.name].quat_wxyz)[:, 2], up, atol=ROUNDING)
    refused(SAMPLE, "expected z or y", up="x")


def test_recognised_by_content(tmp_path):
    edited(tmp_path, "DataType=Quaternion", "DataType=Vec3")
    assert not find_sto(listed(tmp_path))
    (one,) = find_sto(listed(SAMPLE))
    assert one.about == "OpenSim orientations, 7 sensors" and one.path == SAMPLE


@pytest.mark.parametrize(
    ("old", "new"), [("DataRate", "\ufeffDataRate"), ("version=3", "version = 3"), ("\n0\t", "\n0.0\t")]
)
def test_forms_of_one_file(tmp_path, old, new):
    again = read_sto(edited(tmp_path, old, new))
    np.testing.assert_array_equal(again["pelvis_imu"].quat_wxyz, read_sto(SAMPLE)["pelvis_imu"].quat_wxyz)


def test_windows_line_ends(tmp_path):
    file = edited(tmp_path, "version=3", "version=3")
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert len(read_sto(file)["pelvis_imu"]) == 6


def test_missing_orientations_are_nan(tmp_path):
    first = SAMPLE.read_text().split("\n0\t")[1].split("\t")[0]
    recording = read_sto(edited(tmp_path, first, "nan,nan,nan,nan"))
    assert np.isnan(recording["pelvis_imu"].quat_wxyz[0]).all()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.5064886386335554", "x", [":7", '"pelvis_imu"', "no quaternion"]),
        ("0.5064886386335554,", "", [":7", '"pelvis_imu"', "no quaternion"]),
        ("0.5064886386335554", "1.5", [":7", '"pelvis_imu"', "norm"]),
        ("\n0.01\t", "\n0\t", [":8", '"time"', "repeats"]),
        ("\n0.01\t", "\nnan\t", [":8", '"time"', "missing"]),
        ("endheader", "end", ["not a table of orientations"]),
        ("DataType=Quaternion", "DataType=double", ["not a table of orientations"]),
    ],
)
def test_mistakes(tmp_path, old, new, words):
    refused(edited(tmp_path, old, new), *words)


@pytest.mark.data
def test_whole_recording_to_the_last_bit():
    folder = local_folder("data/opensim_core/Applications/opensense/tests/resources")
    found = find_sto(listed(folder))
    assert len(found) == 5
    for one in found:
        time_s, quat = independent(one.path)
        recording = read_sto(one.path)
        np.testing.assert_array_equal(
            recording["torso_imu" if "torso_imu" in quat else "pelvis_imu"].time_s, time_s
        )
        for stream in recording:
            np.testing.assert_array_equal(stream.quat_wxyz, quat[stream.name])
