"""A model with a ball joint from its file to the report: simulated, tracked, smoothed, kept, scored, shown."""

import json
from pathlib import Path

import numpy as np
import pytest

import oarlock
from ball_body import BallBody
from command_line import run
from oarlock.cli import model_sheet
from oarlock.cli.model import posture
from oarlock.cli.terminal import WIDTH, UsageError
from oarlock.evaluation.frames import evaluate_frame_orientations
from oarlock.model.chain_geometry import posture as rest_posture
from oarlock.model.layout import blocks, rows_of
from oarlock.model.rotation import quat_from_rotvec, rotvec_between
from oarlock.report.pose_picture.skeleton import skeleton
from oarlock.report.pose_picture.svg import draw_svg
from test_simulate import assert_signals_agree

ARM = """\
format = 1
name = "ball_arm"
structure = "tree"
joint = [
    { name = "trunk", kind = "hinge" },
    { name = "shoulder", kind = "ball", angles = "YXY", rest = [0.1, 0.2, 0.3] },
    { name = "elbow", kind = "hinge" },
]
frame = [
    { name = "thorax", parent = "root", joint = "trunk", axis = "x", transform.translation = [0.0, 0.1, 0.0] },
    { name = "upperarm", parent = "thorax", joint = "shoulder", transform.translation = [0.15, 0.4, 0.0] },
    { name = "forearm", parent = "upperarm", joint = "elbow", axis = "x", transform.translation = [0.0, -0.3, 0.0] },
    { name = "hand", parent = "forearm", transform.translation = [0.0, -0.27, 0.0] },
]
[world]
up = "y"
forward = "z"
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.05
magnetic_azimuth_rad = 0.4
[process]
hinge = { kind = "jerk", density = 40.0, start_std = [0.2, 0.5, 5.0] }
ball = { kind = "jerk", density = 40.0, start_std = [0.3, 0.5, 5.0] }
"""
UNITS = {"back": "thorax", "arm": "upperarm", "fore": "forearm"}
UNIT = """
[[sensor]]
name = "{name}"
kind = "imu"
frame = "{frame}"
mount.offset = [0.03, -0.2, 0.01]
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 0.8
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("ball") / "ball_arm.toml"
    units = "".join(UNIT.format(name=name, frame=frame) for name, frame in UNITS.items())
    file.write_text(ARM + units, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def model(file) -> oarlock.Model:
    return oarlock.load_model(file)


@pytest.fixture(scope="module")
def motion() -> oarlock.simulation.Motion:
    """The shoulder goes through half turns; it starts where the fit of the first samples finds it from rest."""
    random, time_s = np.random.default_rng(0), np.arange(0.0, 12.5, 0.02)

    def wave(n, reach):
        return reach * np.sin(np.outer(time_s, random.uniform(0.5, 2.0, n)) + random.uniform(0.0, 6.0, n))

    turn = wave(3, 1.3) * (1.0 - 0.95 * np.exp(-((time_s / 2.0) ** 2)))[:, None]
    return oarlock.simulation.Motion.from_joints(
        time_s, {"elbow": wave(1, 0.5)[:, 0], "shoulder": quat_from_rotvec(turn), "trunk": wave(1, 0.3)[:, 0]}
    )


@pytest.fixture(scope="module")
def simulated(model, motion) -> tuple[oarlock.Track, oarlock.Recording]:
    return oarlock.simulate(model, motion, seed=1)


@pytest.fixture(scope="module")
def track(model, simulated) -> oarlock.Track:
    return oarlock.track(model, simulated[1])


def test_truth_holds_rotation_vectors_and_body_rates(model, motion, simulated):
    truth = simulated[0]
    assert truth.coordinate_names == ("trunk", "shoulder.rx", "shoulder.ry", "shoulder.rz", "elbow")
    assert truth["shoulder"].angle_sequence == "YXY"
    for found, wanted in zip((truth.q, truth.qd, truth.qdd), motion.derivatives(truth.time_s), strict=True):
        order = [motion.coordinate_names.index(name) for name in truth.coordinate_names]
        assert np.array_equal(found, wanted[:, order])


def test_differentiated_poses_agree_with_the_models_body_rates(model, motion):
    assert_signals_agree(model, motion)


def test_a_ball_joint_is_tracked_and_its_bands_hold(track, simulated):
    truth = simulated[0]
    evaluation = oarlock.evaluate(track, truth)
    # noise of 0.01 rad/s and 0.8 of 47 uT: the filter knows postures to a fraction of a degree
    assert evaluation.worst_rmse_deg() < 0.5
    assert evaluation["shoulder"].correlation > 0.999
    assert 0.85 < evaluation.mean_coverage() <= 1.0
    assert evaluation.states.nees < 1.5
    smoothed = oarlock.evaluate(oarlock.smooth(track), truth)
    assert smoothed["shoulder"].rmse < evaluation["shoulder"].rmse
    frames = evaluate_frame_orientations(track, truth)
    assert frames.mean_rmse_deg() < 0.5
    relative = evaluate_frame_orientations(track, truth, ["upperarm"], relative_to="thorax")
    assert relative["upperarm"].rmse_rad == pytest.approx(evaluation["shoulder"].rmse, rel=1e-6)


def test_slow_states_are_no_coordinates(track):
    assert not any("shoulder" in name or "trunk" in name for name in track.slow)
    assert {"azimuth", "arm.gyro_bias_x"} <= set(track.slow)


def test_a_track_and_its_model_come_back(track, tmp_path):
    track.save(tmp_path)
    loaded = oarlock.load_track(tmp_path)
    assert np.array_equal(loaded.frame_quat_wxyz("hand"), track.frame_quat_wxyz("hand"))
    assert np.array_equal(loaded["shoulder"].angles_rad(), track["shoulder"].angles_rad())
    assert loaded.beliefs.state_names == track.beliefs.state_names


def test_chosen_start_is_by_coordinate(model, simulated):
    truth, recording = simulated
    start = oarlock.Config(initial_q=[float(value) for value in truth.q[0]])
    track = oarlock.track(model, recording.slice(end_s=2.0), config=start)
    turn = rotvec_between(track["shoulder"].quat_wxyz, truth["shoulder"].quat_wxyz[: len(track.time_s)])
    assert np.degrees(np.linalg.norm(turn[-1])) < 2.0


# --- shown --------------------------------------------------------------------------------------------


def test_the_sheet_shows_a_ball_and_its_coordinates(file):
    shown = run("model", "show", file, "--at", "shoulder.rx=1.0")
    assert "shoulder.rx, .ry, .rz" in shown.stdout and "y1, x, y2" in shown.stdout
    assert "6 11 17" in shown.stdout  # the rest posture in degrees
    assert max(map(len, shown.stdout.splitlines())) <= WIDTH
    assert "5 coordinates" in run("model", "check", file).stdout
    refused = run("model", "show", file, "--at", "shoulder=1.0", status=2)
    assert "shoulder.rx, shoulder.ry, shoulder.rz" in refused.stderr


def test_the_command_line_tracks_and_scores_it(file, simulated, tmp_path):
    truth, recording = simulated
    recording.slice(end_s=4.0).save(tmp_path / "trial")
    truth.save(tmp_path / "truth")
    tracked = run("track", tmp_path / "trial", "--model", file, "--out", tmp_path / "out", "--json")
    assert json.loads(tracked.stdout)["joints"] == 3
    scored = run("evaluate", tmp_path / "out", tmp_path / "truth", "--start-s", 1)
    assert "shoulder YXY x" in scored.stdout
    run("report", tmp_path / "out", "--truth", tmp_path / "truth")


def test_a_posture_is_by_coordinate():
    description = BallBody().describe()
    q = posture(description, {"shoulder.rz": 0.3, "elbow": 0.2}, "--at")
    assert len(q) == 12
    assert (q[10], q[11], sum(q)) == (0.3, 0.2, 0.5)
    with pytest.raises(UsageError, match=r"shoulder\.rx"):
        posture(description, {"sholder.rx": 1.0}, "--at")
    assert rest_posture(BallBody(), {"shoulder.rz": 0.3})[10] == 0.3


def test_a_sheet_of_free_and_ball_joints(capsys):
    model_sheet.write(BallBody().describe())
    printed = capsys.readouterr().out
    assert "pelvis.x, .y, .z, .rx, .ry, .rz" in printed
    assert "0.00 0.00 0.00 0 0 0" in printed
    assert "0-5, 12-17, 24-29" in printed
    assert max(map(len, printed.splitlines())) <= WIDTH


def test_layout_of_coordinates():
    rows = ("trunk", "arm.rx", "arm.ry", "trunk.velocity", "arm.rx.velocity", "arm.gyro_bias_x")
    assert rows_of("arm", rows) == "1-2, 4-5"
    assert [(b.kind, b.rows) for b in blocks(rows, {"trunk": "joints", "arm": "joints"})] == [
        ("joints", "0-2"),
        ("velocity of joints", "3-4"),
        ("sensor biases", "5"),
    ]


def test_a_free_body_hangs_on_nothing_and_a_ball_on_a_straight_link():
    body = BallBody()
    drawn = skeleton(body, np.zeros(12))
    assert [spot.name for spot in drawn.spots][:2] == ["root", "thorax"]
    q = np.zeros(12)
    q[:3] = 1.0, 2.0, 3.0
    away = skeleton(body, q)
    assert len(away.links) == 5
    assert min(np.linalg.norm(link.start) for link in away.links) > 1.0
    assert "pelvis" in draw_svg(away, "a body")
