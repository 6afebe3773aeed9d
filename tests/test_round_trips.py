"""What one command writes, the next one reads: chains of commands that no page shows one after the other."""

import shutil
from dataclasses import replace

import pytest

import oarlock
from command_line import run
from oarlock.model.shipped_files import model_names

ROWERS = ("ergometer", "sculler", "sculler_boat", "sweep", "sweep_starboard")
UNSIMULATED = {
    "sculler_ball": "no joint 'r_shoulder_abduction'",
    "sculler_table2": "beyond the stretched arm",
}
BODIES = sorted(set(model_names()) - {*ROWERS, *UNSIMULATED})


def most_are_long(names, quick):
    return [name if name in quick else pytest.param(name, marks=pytest.mark.long) for name in names]


@pytest.fixture(scope="module")
def piece(tmp_path_factory):
    """A simulated piece, its track and everything that is written from it."""
    place = tmp_path_factory.mktemp("piece")
    run("simulate", "--out", place / "rec", "--duration-s", 6)
    run("track", place / "rec", "--model", "sculler", "--out", place / "track")
    run("export", place / "track", "--out", place / "exported")
    return place


@pytest.mark.parametrize("name", most_are_long(BODIES, ("arm", "dfjimu", "pendulum3")))
def test_a_session_is_tracked_with_the_calibration_written_beside_it(name, tmp_path):
    model = oarlock.load_model(name)
    plan = oarlock.calibration.default_plan(model)
    trial = oarlock.simulation.simulate_session(model, replace(plan, steps=plan.steps[:2]), rate_hz=50.0)
    trial.save(tmp_path / "rec")
    true = ["--calibration", tmp_path / "rec/true_calibration.toml"]
    run("track", tmp_path / "rec", "--model", name, *true, "--out", tmp_path / "track")
    run("model", "check", tmp_path / "track/model.toml")
    run(
        "track",
        tmp_path / "rec",
        "--model",
        tmp_path / "track/model.toml",
        *true,
        "--out",
        tmp_path / "again",
    )
    run("evaluate", tmp_path / "again", tmp_path / "rec/truth")


@pytest.mark.parametrize("name", most_are_long(ROWERS, ("sculler",)))
def test_a_piece_is_tracked_with_the_model_written_beside_it(name, tmp_path):
    run("simulate", "--model", name, "--out", tmp_path / "rec", "--duration-s", 3)
    run("track", tmp_path / "rec", "--model", tmp_path / "rec/truth/model.toml", "--out", tmp_path / "track")
    run("evaluate", tmp_path / "track", tmp_path / "rec/truth")


@pytest.mark.parametrize("name", UNSIMULATED)
def test_a_model_that_cannot_be_simulated_is_refused_with_the_reason(name, tmp_path):
    done = run("simulate", "--model", name, "--out", tmp_path / "rec", "--duration-s", 2, status=1)
    assert UNSIMULATED[name] in done.output
    assert not (tmp_path / "rec").exists()


def test_a_field_piece_is_tracked_and_scored_with_what_was_written_beside_it(tmp_path):
    run("simulate", "--field", "careful", "--out", tmp_path / "rec", "--duration-s", 4)
    run("markers", "show", tmp_path / "rec/markers.csv")
    true = ["--calibration", tmp_path / "rec/true_calibration.toml"]
    run("track", tmp_path / "rec", "--model", "sculler", *true, "--out", tmp_path / "track")
    run("evaluate", tmp_path / "track", tmp_path / "rec")


def test_an_earlier_run_gives_settings_and_model(piece, tmp_path):
    earlier = piece / "track"
    settings = ["--model", earlier / "model.toml", "--config", earlier / "run.toml"]
    run("track", piece / "rec", *settings, "--out", tmp_path / "again")
    assert (oarlock.load_track(tmp_path / "again").q == oarlock.load_track(earlier).q).all()


@pytest.mark.parametrize("file", ["frames.c3d", "frames.trc", "frames.csv"])
def test_exported_frames_are_markers(piece, file):
    run("markers", "show", piece / "exported" / file)
    run("evaluate", piece / "track", piece / "exported" / file)


def test_exported_orientations_are_a_recording(piece, tmp_path):
    run("import", piece / "exported/orientations.sto", "--out", tmp_path / "rec")
    assert oarlock.load_recording(tmp_path / "rec").end_s == pytest.approx(
        oarlock.load_track(piece / "track").time_s[-1], abs=0.02
    )


def test_strokes_of_a_track_are_an_activity_file_with_strokes(piece, tmp_path):
    run(
        "rowing",
        "strokes",
        piece / "track",
        "--fit",
        tmp_path / "piece.fit",
        "--start",
        "2026-05-01T07:30:00Z",
    )
    run("rowing", "strokes", tmp_path / "piece.fit")


def test_a_recording_of_oarlock_needs_no_import_and_says_so(piece, tmp_path):
    shutil.copytree(piece / "rec", tmp_path / "live/recording")
    for place, own in ((piece / "rec",) * 2, (tmp_path / "live", tmp_path / "live/recording")):
        done = run("import", place, "--out", tmp_path / "rec", status=1)
        assert f"{own}: is a recording of Oarlock already" in " ".join(done.output.split())


@pytest.mark.long
def test_a_plan_that_was_written_is_read_again(tmp_path):
    run("simulate", "--calibration-session", "--model", "arm7", "--out", tmp_path / "rec")
    run("calibrate", "session", "--model", "arm7", "--write-plan", tmp_path / "plan.toml")
    words = ["calibrate", "session", tmp_path / "rec", "--model", "arm7"]
    run(*words, "--plan", tmp_path / "plan.toml", "--out", tmp_path / "cal.toml")
    run(*words, "--plan", tmp_path / "rec/plan.toml", "--out", tmp_path / "own.toml")
    run(
        "track",
        tmp_path / "rec",
        "--model",
        "arm7",
        "--calibration",
        tmp_path / "own.toml",
        "--out",
        tmp_path / "t",
    )


def test_a_session_of_a_unit_whose_magnetometer_the_model_leaves_out_is_tracked(piece, tmp_path):
    shutil.copytree(piece / "rec", tmp_path / "rec")
    offsets = "[mag_offsets_ut]\nback = [1.0, 2.0, 3.0]\n"
    (tmp_path / "cal.toml").write_text(f"format = 1\n[mounts]\n[parameters]\n{offsets}", encoding="utf-8")
    model = tmp_path / "plain.toml"
    run("model", "copy", "sculler", model)
    lines = model.read_text(encoding="utf-8").splitlines(keepends=True)
    model.write_text("".join(line for line in lines if not line.startswith("mag_std_ut")), encoding="utf-8")
    words = ["track", tmp_path / "rec", "--model", model, "--calibration", tmp_path / "cal.toml"]
    run(*words, "--out", tmp_path / "track")
    (tmp_path / "cal.toml").write_text(
        (tmp_path / "cal.toml").read_text("utf-8").replace("back", "bakc"), "utf-8"
    )
    assert "did you mean `back`" in run(*words, "--out", tmp_path / "other", status=1).output
