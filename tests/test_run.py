"""`oarlock run` and `oarlock calibrate sagittal`: from files to angles and a report."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.calibration import SessionPlan, SessionStep
from oarlock.cli.result import result_of
from oarlock.movement.report import movement_front
from oarlock.recording.unit_names import renamed
from oarlock.report import fixed
from refusals import assert_refused
from walking_body import walk

MEAN_MOUNT_DEG = 4.0
SIZE = ("--stature-m", 1.78, "--mass-kg", 75)
LEG = ["pelvis", "thigh_r", "shank_r"]
BODY = ("--model", "lower_body", "--sensors", ",".join(LEG))


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
    said = run("run", recording, "--model", "lower_body", "--out", out).output
    assert (out / "calibration.toml").is_file() and (out / "track/report.html").is_file()
    angle_rad = oarlock.load_track(out / "track")["knee_flexion_r"].angle_rad
    assert np.ptp(angle_rad) > np.radians(40.0)
    heading = "pelvis: the heading of its mount is not determined (standard deviation 104 deg)"
    assert heading in " ".join(said.split()) and "`oarlock calibrate session`" in " ".join(said.split())
    assert "knee flexion" in said and f"open {out / 'track/report.html'}" in said
    assert re.search(r"deg \(range \d+ \+- \d+\)", " ".join(said.split()))


@pytest.mark.parametrize("blocks", ["one", "several"])
def test_terminal_and_page_give_one_number_for_an_angle(recording, tmp_path, blocks):
    command, out = ("run", recording, "--model", "lower_body"), tmp_path / "out"
    if blocks == "several":  # a bow, swings of an arm and bends of the elbow
        run("simulate", "--model", "arm", *SIZE, "--out", tmp_path / "session")
        command = ("run", tmp_path / "session", "--model", "arm", "--session", tmp_path / "session", *SIZE)
    said = " ".join(run(*command, "--out", out).output.split())
    angles = result_of(oarlock.load_track(out / "track"))["angles"]
    page = (out / "track/report.html").read_text()
    assert {one["block"] for one in angles} == ({None} if blocks == "one" else {1, 2, 3})
    unusable = said.partition("not usable, the heading of a unit beside it is not determined: ")[2]
    assert ("hip flexion R" in unusable) == (blocks == "one")
    assert said.count("+-: half of the 95 % interval of the range") == 1
    for one in angles:
        if one["doubt"].startswith("the heading"):
            assert not re.search(rf"{one['name'].removesuffix('_r').replace('_', ' ')} R -?\d", said), one
            continue
        measured = [one["range_deg"], one["band_deg"]]
        if not one["doubt"]:
            measured += [one["low_deg"], one["high_deg"]]
            assert all(f">{fixed(value, 1)}<" in page for value in measured), one
        else:
            assert f"{fixed(measured[0], 1)} ± {fixed(measured[1], 1)}" in page, one
        assert f"(range {one['range_deg']:.0f} +- {one['band_deg']:.0f}" in said, one


def test_angles_beside_a_unit_without_heading_have_no_numbers(tmp_path):
    walk(11, leaning_rad=0.05, duration_s=25.0).recording.save(tmp_path / "rec")
    printed = run("run", tmp_path / "rec", "--model", "lower_body", *SIZE, "--out", tmp_path / "out").output
    said = " ".join(printed.split())
    assert re.search(r"knee flexion.* \d+ deg \(range \d+ \+- \d+\)", said)
    assert not re.search(r"hip \w+ [RL] -?\d", said)
    (meaning,) = (
        line for line in printed.splitlines() if line.startswith("range: mean of the cycles; ends: ")
    )
    assert meaning.endswith("half of the 95 % interval of the range")
    track = oarlock.load_track(tmp_path / "out/track")
    title, front = movement_front(track)
    headlines = [
        title or "",
        *(one.name for one in front.figures),
        *(front.course.curves if front.course else ()),
    ]
    assert not any("hip" in text for text in headlines)
    assert "pelvis bending forward by 20°" in front.next_step and front.commands and not front.sensors_step
    page = (tmp_path / "out/track/report.html").read_text()
    cells = re.findall(r"hip \w+</span></th><td[^>]*>(.*?)</td>", page)
    assert cells and set(cells) == {"–"}


def test_a_step_that_fails_ends_it(recording, tmp_path):
    still = oarlock.load_recording(recording).slice(-np.inf, 2.5)
    still.save(tmp_path / "still")
    run("run", tmp_path / "still", "--model", "lower_body", "--out", tmp_path / "out", status=1)
    assert not (tmp_path / "out/track").exists()


def test_two_sources_of_mounts_contradict_each_other(recording, tmp_path):
    both = ("--session", recording, "--calibration", tmp_path / "cal.toml")
    shown = run("run", recording, "--model", "lower_body", *both, "--out", tmp_path / "out", status=2).stderr
    assert "--session and --calibration contradict each other" in shown


def test_a_folder_that_exists_is_replaced_only_with_force(recording, tmp_path):
    command = ("run", recording, "--model", "lower_body", "--out", tmp_path / "out")
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
    run("run", recording, "--model", "lower_body", "--calibration", known, "--out", out)
    assert not (out / "calibration.toml").exists()
    run("track", recording, *BODY, "--calibration", known, "--smooth", "--out", tmp_path / "again")
    once, twice = (oarlock.load_track(place) for place in (out / "track", tmp_path / "again"))
    np.testing.assert_array_equal(once.q, twice.q)


def test_a_session_in_another_pose(tmp_path):
    body = oarlock.load_model("lower_body").with_units(LEG)
    guided = oarlock.simulation.simulate_session(
        body, oarlock.calibration.default_plan(body, "sitting"), seed=2
    )
    guided.recording.save(tmp_path / "session")
    walk(0, model=body, duration_s=8.0).recording.save(tmp_path / "rec")
    command = (
        "run",
        tmp_path / "rec",
        "--model",
        "lower_body",
        "--out",
        tmp_path / "out",
        "--pose",
        "sitting",
    )
    assert "--session" in run(*command, status=2).output
    run(*command, "--session", tmp_path / "session")
    noted = oarlock.load_calibration(tmp_path / "out/calibration.toml").noted["session"]
    assert "sitting again" in [step["name"] for step in noted["step"]]
    assert (tmp_path / "out/track/report.html").is_file()


def test_files_of_text_with_a_session_and_names_by_device(tmp_path, monkeypatch):
    """As a user would: text files of three units whose names say nothing, movements, a session, a trial."""
    body = oarlock.load_model("lower_body").with_units(LEG)
    ids = dict(zip(LEG, ("00B4271A", "00B4271C", "00B4271F"), strict=True))
    swing = (SessionStep("swing", "move", joints=("hip_flexion_r",)),)
    rests = (SessionStep("start", "pose"), SessionStep("end", "pose"))
    moves = oarlock.simulation.simulate_session(
        body, SessionPlan("swing", (rests[0], *swing, rests[1])), seed=1
    )
    guided = oarlock.simulation.simulate_session(body, seed=1)
    for name, recording in (
        ("moves", moves.recording),
        ("session", guided.recording),
        ("trial", guided.recording),
    ):
        written_as_text(renamed(recording, ids), tmp_path / name)
    monkeypatch.chdir(tmp_path)
    common = ("--model", "lower_body", "--sensors", ",".join(LEG))
    run("calibrate", "units", "moves", *common, "--order", "right_leg", "--out", "units.toml")
    run("run", "trial", *common, "--units", "units.toml", "--session", "session", "--out", "out")
    assert set(oarlock.load_recording("out/recording").names) == set(LEG)
    off = [
        oarlock.load_calibration("out/calibration.toml").mounts[s][0] @ guided.calibration.mounts[s][0].T
        for s in LEG
    ]
    assert np.degrees(Rotation.from_matrix(np.array(off)).magnitude()).mean() < MEAN_MOUNT_DEG
    assert (tmp_path / "out/track/report.html").is_file()
    assert "Units on the body" in (tmp_path / "out/calibration.html").read_text(encoding="utf-8")


def written_as_text(recording, folder):
    """A folder with one file of comma-separated text with the columns of all units."""
    folder.mkdir()
    header, columns = ["time (s)"], [recording.streams[0].time_s]
    for stream in recording.streams:
        for quantity, unit, values in (
            ("gyro", "rad/s", stream.gyro_rad_s),
            ("acc", "m/s2", stream.accel_m_s2),
        ):
            header += [f"{stream.name} {quantity} {axis} ({unit})" for axis in "xyz"]
            columns += list(values.T)
    table = np.column_stack(columns)
    np.savetxt(folder / "units.csv", table, "%.6f", ",", header=",".join(header), comments="")


def test_stature_is_for_the_name_of_a_model(recording, tmp_path):
    body = oarlock.load_model("lower_body")
    assert_refused(lambda: oarlock.run(recording, tmp_path / "out", model=body, stature_m=1.7), "load_model")
