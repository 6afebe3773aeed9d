"""`oarlock run` and `oarlock calibrate sagittal`: from files to angles and a report."""

import shlex

import numpy as np
import pytest

import oarlock
from command_line import run
from walking_body import walk

LEG = ["pelvis", "thigh_r", "shank_r"]
BODY = ("--model", "lower_body", "--units", ",".join(LEG))


@pytest.fixture
def recording(tmp_path):
    body = oarlock.load_model("lower_body").with_units(LEG)
    folder = tmp_path / "rec"
    walk(0, model=body, duration_s=8.0).recording.save(folder)
    return folder


def test_mounts_from_a_walk(recording, tmp_path):
    out = tmp_path / "cal.toml"
    said = run("calibrate", "sagittal", recording, *BODY, "--out", out).output
    assert "its movement" in said and "stood still from" in said and "oarlock track" in said
    assert set(oarlock.load_calibration(out).mounts) == set(LEG)


def test_from_files_to_a_report(recording, tmp_path):
    out = tmp_path / "walk"
    said = run("run", recording, "--body", "lower_body", "--out", out).output
    assert (out / "calibration.toml").is_file() and (out / "track/report.html").is_file()
    angle_rad = oarlock.load_track(out / "track")["knee_flexion_r"].angle_rad
    assert np.ptp(angle_rad) > np.radians(40.0)
    commands = [shlex.split(line[2:]) for line in said.splitlines() if line.startswith("$ oarlock ")]
    assert [words[1] for words in commands] == ["calibrate", "track"]


def test_a_step_that_fails_ends_it(recording, tmp_path):
    still = oarlock.load_recording(recording).slice(-np.inf, 2.5)
    still.save(tmp_path / "still")
    run("run", tmp_path / "still", "--body", "lower_body", "--out", tmp_path / "out", status=1)
    assert not (tmp_path / "out/track").exists()


def test_two_sources_of_mounts_contradict_each_other(recording, tmp_path):
    both = ("--session", recording, "--calibration", tmp_path / "cal.toml")
    run("run", recording, "--body", "lower_body", *both, "--out", tmp_path / "out", status=2)


def test_a_folder_that_exists_is_replaced_only_with_force(recording, tmp_path):
    command = ("run", recording, "--body", "lower_body", "--out", tmp_path / "out")
    (tmp_path / "out").mkdir()
    (tmp_path / "out/calibration.toml").write_text("mine")
    run(*command, status=2)
    assert (tmp_path / "out/calibration.toml").read_text() == "mine"
    run(*command, "--force")
    assert (tmp_path / "out/track/report.html").is_file()


def test_a_calibration_is_used_as_it_is(recording, tmp_path):
    known = tmp_path / "cal.toml"
    run("calibrate", "sagittal", recording, *BODY, "--out", known)
    out = tmp_path / "out"
    said = run("run", recording, "--body", "lower_body", "--calibration", known, "--out", out).output
    assert "$ oarlock calibrate" not in said and not (out / "calibration.toml").exists()
    (typed,) = [shlex.split(line[2:]) for line in said.splitlines() if line.startswith("$ oarlock ")]
    run(*typed[1:-1], tmp_path / "again")  # the last word is the folder
    once, twice = (oarlock.load_track(place) for place in (out / "track", tmp_path / "again"))
    np.testing.assert_array_equal(once.q, twice.q)
