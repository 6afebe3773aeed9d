"""A robot's arm of two hinges: the structure that tracks it, and notes on its encoder, mounts and abrupt movement."""

from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock import Model
from oarlock.evaluation.summary import summarize
from oarlock.simulation import Motion

ROBOT = """
format = 1
name = "robot"

[world]
up = "z"
forward = "x"

[[joint]]
name = "first"
kind = "hinge"

[[joint]]
name = "second"
kind = "hinge"

[[frame]]
name = "upper"
parent = "root"
transform = { translation = [0, 0, 0.5] }
joint = "first"

[[frame]]
name = "lower"
parent = "upper"
transform = { translation = [0.4, 0, 0] }
axis = "y"
joint = "second"

[[sensor]]
name = "upper"
kind = "imu"
frame = "upper"
mount = { offset = [0.2, 0, 0.02] }
gyro_std_rad_s = 0.005
accel_std_m_s2 = 0.02

[[sensor]]
name = "lower"
kind = "imu"
frame = "lower"
mount = { offset = [0.17, 0, 0.02], std_rad = 0.02 }
gyro_std_rad_s = 0.005
accel_std_m_s2 = 0.02

[[sensor]]
name = "encoder"
kind = "encoder"
joint = "first"
std = 0.01
"""
ENCODER_RAD = 0.01


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("robot") / "robot.toml"
    file.write_text(ROBOT, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def robot(file: Path) -> Model:
    return oarlock.load_model(file)


def moved(model: Model, jump_rad: float = 0.0) -> tuple[oarlock.Track, oarlock.Recording]:
    """Both hinges swing for 12 s; the second also jumps in 0.2 s, forth at 4 s and back at 8 s."""
    time_s = np.arange(0.0, 12.0, 0.005)
    ends = [np.clip((time_s - begin_s) / 0.2, 0.0, 1.0) for begin_s in (4.0, 8.0)]
    forth, back = (x**3 * (10.0 - 15.0 * x + 6.0 * x**2) for x in ends)
    second = 0.3 * np.sin(0.9 * time_s) - jump_rad * (forth - back)
    q = np.column_stack([0.5 * np.sin(0.6 * time_s), second])
    return oarlock.simulate(model, Motion(model.joint_names, time_s, q), seed=1, rate_hz=100.0)


def test_a_check_says_which_structure_tracks_it(file: Path) -> None:
    said = " ".join(run("model", "check", file).output.split())
    assert 'tracked as strapdown links, joints = "hand_rig", by default; structure = "tree"' in said
    assert "tracked as a tree" in run("model", "check", "openaxes_ur5").output


@pytest.mark.parametrize("structure", ["strapdown", "tree"])
def test_a_track_says_which_structure_tracked_it(robot: Model, structure: str) -> None:
    chosen = {} if structure == "strapdown" else {"structure": "tree"}
    track = oarlock.track(robot, moved(robot)[1].slice(end_s=2.0), **chosen)
    assert summarize(track).structure == track.provenance["structure"] == structure


def test_an_encoder_that_is_taken_as_it_is_has_a_note(robot: Model) -> None:
    without_unit = robot.without(sensors=["upper"])
    truth, recording = moved(without_unit)
    note = "first: the value is the reading of the encoder, because no inertial unit is on the link"
    errors = {}
    for structure in (None, "tree"):
        track = oarlock.track(without_unit, recording, structure=structure, smooth=True)
        true_rad = np.interp(track.time_s, truth.time_s, truth["first"].angle_rad)
        errors[structure] = float(np.std(track["first"].angle_rad - true_rad))
        texts = [text for text in track.notes if text.code == "encoder_as_read"]
        assert [text.startswith(note) for text in texts] == [True] * (structure is None), track.notes
    assert errors[None] == pytest.approx(ENCODER_RAD, rel=0.1)
    assert errors["tree"] < ENCODER_RAD / 5.0
    chosen = oarlock.track(without_unit, recording, structure="strapdown")
    fused = oarlock.track(robot, moved(robot)[1])
    assert not any(text.code == "encoder_as_read" for text in (*chosen.notes, *fused.notes))


def test_a_mount_that_the_file_states_is_known(robot: Model) -> None:
    track = oarlock.track(robot, moved(robot)[1].slice(end_s=2.0))
    assert track.provenance["nominal_mounts"] == ["upper"]
    (note,) = (text for text in track.notes if text.code == "nominal_mounts")
    assert note.startswith("mounts: nominal for upper;") and "`std_rad = 0.02`" in note


def test_an_abrupt_movement_that_the_gate_rejects_has_a_note(robot: Model) -> None:
    truth, recording = moved(robot, jump_rad=0.4)
    track = oarlock.track(robot, recording, structure="tree")
    (note,) = (text for text in track.notes if text.code == "rejected")
    count = next(one for one in track.counts if one.name == "lower")
    assert 0 < count.rejected < 0.05 * count.received
    assert note.startswith(f"lower: {count.rejected} of {count.received} readings")
    assert "samples in a row from 4.0" in note and "`--set gate=false`" in note
    for settings in ({"gate": False}, {"structure": "strapdown"}):
        track = oarlock.track(robot, recording, **{"structure": "tree", **settings})
        true_rad = np.interp(track.time_s, truth.time_s, truth["second"].angle_rad)
        assert not any(text.code == "rejected" for text in track.notes)
        assert np.abs(track["second"].angle_rad - true_rad).max() < np.radians(1.0)


def test_a_reading_that_jumps_alone_has_no_note(robot: Model) -> None:
    recording = moved(robot)[1]
    streams = []
    for stream in recording:
        values = {name: rows.copy() for name, rows in stream.values.items()}
        if stream.name == "encoder":
            values["value"][[400, 700, 701]] += 1.0
        streams.append(type(stream)(stream.name, stream.time_s, **values))
    track = oarlock.track(robot, oarlock.Recording(streams), structure="tree")
    assert next(one for one in track.counts if one.name == "encoder").rejected == 3
    assert not any(text.code == "rejected" for text in track.notes)
