"""`oarlock simulate --calibration-session` and `oarlock calibrate session`: files, page, exit status."""

import json

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.report.session_page import session_page
from oarlock.rowing import session_skin
from oarlock.storage.errors import DataError

# The field simulator's careful session: cuffs lag by 15 % of a turn, muscles tilt a unit by 2 deg at 90 deg.
SKIN_TILT_RAD = np.radians(2.0)
TILT_TOLERANCE_RAD = np.radians(0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("session")
    run("simulate", "--calibration-session", "--model", "arm7", "--seed", 5, "--out", place / "rec")
    return place


def test_a_session_becomes_a_calibration_and_a_page(folder):
    done = run("calibrate", "session", folder / "rec", "--model", "arm7", "--out", folder / "cal.toml")
    for words in ("N-pose again", "pass", "Passed.", "mount", "magnetometer", "oarlock track"):
        assert words in done.output
    found = oarlock.load_calibration(folder / "cal.toml")
    true = oarlock.load_calibration(folder / "rec/true_calibration.toml")
    assert set(found.mounts) == set(true.mounts)
    page = (folder / "cal.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert "Passed" in page and "Steps to repeat" not in page
    assert "http" not in page.replace("http-equiv", "")


def test_a_body_that_does_not_row_is_simulated_in_its_session(tmp_path):
    done = run("simulate", "--model", "arm", "--out", tmp_path / "rec")
    assert "simulates its calibration session" in done.output
    assert (tmp_path / "rec/plan.toml").is_file()


def test_what_has_to_be_done_again_ends_with_status_1(folder):
    recording = oarlock.load_recording(folder / "rec")
    recording.slice(-np.inf, recording.end_s - 20.0).save(folder / "short")
    done = run(
        "calibrate",
        "session",
        folder / "short",
        "--model",
        "arm7",
        "--out",
        folder / "s.toml",
        "--json",
        status=1,
    )
    told = json.loads(done.stdout)
    assert not told["session"]["passed"]
    assert (folder / "s.toml").exists()
    assert "Steps to repeat" in (folder / "s.html").read_text(encoding="utf-8")


def test_the_plan_can_be_written_and_changed(folder):
    run("calibrate", "session", "--model", "arm7", "--write-plan", folder / "plan.toml")
    plan = oarlock.calibration.load_session_plan(folder / "plan.toml")
    assert plan == oarlock.calibration.default_plan(oarlock.load_model("arm7"))


def test_usage(folder):
    command = ("calibrate", "session", folder / "rec", "--model", "arm7")
    assert "--out FILE" in run(*command, status=2).output
    (folder / "there.toml").write_text("")
    assert "exists" in run(*command, "--out", folder / "there.toml", status=2).output


def test_a_page_needs_a_session():
    with pytest.raises(DataError, match="calibrate_session"):
        session_page(oarlock.Calibration())


def test_skin_is_at_rest_where_arms_hang_and_tilts_where_they_bend():
    model = oarlock.load_model("sculler")
    skin = session_skin(model, seed=1)
    time_s = np.linspace(0.0, 2.0, 41)
    q = np.zeros((41, len(model.coordinate_names)))
    q[:, model.coordinate_names.index("r_elbow_flexion")] = np.linspace(0.0, np.pi / 2, 41)
    sensor = next(s for s in model.describe().sensors if s.name == "r_upperarm")
    turn = skin(sensor, time_s, q)
    assert np.linalg.norm(turn[0]) < TILT_TOLERANCE_RAD
    assert np.linalg.norm(turn[-1]) == pytest.approx(SKIN_TILT_RAD, abs=TILT_TOLERANCE_RAD)
