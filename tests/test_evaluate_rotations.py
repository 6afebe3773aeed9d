"""Scores of ball and free joints, and of the orientations of frames, against closed forms."""

import json
from dataclasses import replace

import numpy as np
import pytest

import oarlock
from ball_body import BallBody, noisy, plus, true_track, with_beliefs
from oarlock.cli.tables import write_evaluation
from oarlock.evaluation.evaluate import evaluate
from oarlock.evaluation.frames import evaluate_frame_orientations
from oarlock.evaluation.reference import Reference
from oarlock.model.rotation import quat_from_rotvec, quat_inverse, quat_product, rotvec_from_quat
from oarlock.report import write_page
from test_report import Page

EXACT = 1e-9
FIVE_SIGMA = 5.0
"""Statistical bounds: a right result leaves them once in two million draws."""
SPLINE_RAD = 1e-5
"""Cubic spline through quaternions at 50 Hz of turns of up to 2 rad/s; ends are worse."""
STD = np.concatenate([np.full(3, 0.01), np.full(3, 0.02), [0.02, 0.01], np.full(3, 0.02), [0.02]])
SHOULDER = slice(8, 11)


@pytest.fixture(scope="module")
def truth() -> oarlock.Track:
    return true_track(BallBody(), 40.0)


@pytest.fixture(scope="module")
def track(truth) -> oarlock.Track:
    return noisy(truth, STD, seed=1)


def moved(truth, error) -> oarlock.Track:
    """The truth with a constant error in tangent coordinates, (12,), and bands of 0.02."""
    whole = np.broadcast_to(error, truth.q.shape)
    return replace(truth, q=plus(truth, truth.q, whole), q_std=np.full(truth.q.shape, 0.02))


# --- joints -------------------------------------------------------------------------------------------


def test_a_free_joint_is_scored_twice_and_a_ball_once(track, truth):
    evaluation = evaluate(track, truth)
    assert [(s.name, s.unit) for s in evaluation.joints] == [
        ("pelvis.position", "m"),
        ("pelvis.rotation", "rad"),
        ("trunk", "rad"),
        ("rail", "m"),
        ("shoulder", "rad"),
        ("elbow", "rad"),
    ]
    names = [part.name for part in evaluation["shoulder"].parts]
    assert names[:3] == ["shoulder.rx", "shoulder.ry", "shoulder.rz"]
    assert names[3:] == ["shoulder YXY y1", "shoulder YXY x", "shoulder YXY y2"]
    assert [p.name for p in evaluation["pelvis.position"].parts] == ["pelvis.x", "pelvis.y", "pelvis.z"]
    assert evaluation["pelvis.rotation"].parts[3].name == "pelvis.rotation ZXY z"


def test_a_constant_error_is_its_angle_and_its_components(truth):
    error = np.zeros(12)
    error[SHOULDER] = 0.03, -0.04, 0.0
    error[:3] = 0.001, 0.002, -0.002
    evaluation = evaluate(moved(truth, error), truth)
    score = evaluation["shoulder"]
    assert score.rmse == pytest.approx(0.05, abs=EXACT)
    assert score.bias == pytest.approx(0.05, abs=EXACT)
    assert [part.bias for part in score.parts[:3]] == pytest.approx([0.03, -0.04, 0.0], abs=EXACT)
    assert score.nees == pytest.approx((1.5**2 + 2.0**2) / 3, abs=1e-6)
    assert score.coverage == pytest.approx(2 / 3)
    assert [part.coverage for part in score.parts[:3]] == [1.0, 0.0, 1.0]
    place = evaluation["pelvis.position"]
    assert place.rmse == pytest.approx(0.003, abs=EXACT)
    assert [part.bias for part in place.parts] == pytest.approx([0.001, 0.002, -0.002], abs=EXACT)
    assert evaluation["pelvis.rotation"].rmse == pytest.approx(0.0, abs=EXACT)


def test_gaussian_errors_are_covered_and_consistent_about_every_axis(track, truth):
    evaluation = evaluate(track, truth)
    n = evaluation.samples
    for name, std in (("pelvis.position", 0.01), ("pelvis.rotation", 0.02), ("shoulder", 0.02)):
        score = evaluation[name]
        assert abs(score.rmse / (std * np.sqrt(3)) - 1) < FIVE_SIGMA / np.sqrt(6 * n)
        assert score.mean_std == pytest.approx(std * np.sqrt(3))
        assert abs(score.nees - 1) < FIVE_SIGMA * np.sqrt(2 / (3 * n))
        for part in score.parts[:3]:
            assert abs(part.rmse / std - 1) < FIVE_SIGMA / np.sqrt(2 * n)
            assert abs(part.coverage - 0.95) < FIVE_SIGMA * np.sqrt(0.95 * 0.05 / n)
        for part in score.parts[3:]:
            # first order: bands of angles are off by the square of the error over the sine of 15 deg
            assert abs(part.coverage - 0.95) < FIVE_SIGMA * np.sqrt(0.95 * 0.05 / part.samples) + 0.01
            assert abs(part.nees - 1) < FIVE_SIGMA * np.sqrt(2 / part.samples) + 0.05
            assert part.correlation > 0.99


def test_named_angles_leave_out_what_is_near_singular(track, truth):
    angle = evaluate(track, truth)["shoulder"].parts[3]
    near = track["shoulder"].near_singular() | truth["shoulder"].near_singular()
    kept = track.time_s >= 2.0
    assert near[kept].any()
    assert angle.samples == np.count_nonzero(kept & ~near)
    assert angle.note == f"{100 * near[kept].mean():.0f} % near singular, left out"


def test_a_whole_turn_is_no_error(truth):
    q = truth.q.copy()
    r = q[:, SHOULDER]
    q[:, SHOULDER] = r * (1 - 2 * np.pi / np.linalg.norm(r, axis=1, keepdims=True))
    score = evaluate(replace(truth, q=q), truth)["shoulder"]
    assert score.rmse == pytest.approx(0.0, abs=EXACT)
    assert score.correlation == pytest.approx(1.0, abs=EXACT)


def test_correlation_is_that_of_a_hinge_where_a_ball_is_one():
    """About one axis the three components together are that angle, so Pearson's correlation is the same."""
    body = BallBody({"shoulder": "ball", "elbow": "hinge"})
    truth = true_track(body, 20.0)
    angle = 0.5 * np.sin(truth.time_s)
    noise = 0.2 * np.random.default_rng(3).standard_normal(len(truth.time_s))
    axis = np.array([0.48, 0.6, 0.64])
    true, found = (np.column_stack([np.outer(a, axis), a]) for a in (angle, angle + noise))
    evaluation = evaluate(replace(truth, q=found), replace(truth, q=true))
    assert evaluation["shoulder"].correlation == pytest.approx(evaluation["elbow"].correlation, abs=EXACT)


def test_a_ball_that_rests_has_no_correlation(truth):
    still = truth.q.copy()
    still[:, SHOULDER] = 0.3
    evaluation = evaluate(replace(truth, q=still), replace(truth, q=still.copy()))
    assert np.isnan(evaluation["shoulder"].correlation)
    assert next(row for row in evaluation.rows if row["joint"] == "shoulder")["note"] == "constant"


def test_truth_at_other_stamps_is_interpolated_on_the_rotations(truth):
    body = BallBody()
    shifted = true_track(body, 40.0, rate_hz=61.0)
    assert evaluate(shifted, truth)["shoulder"].rmse < SPLINE_RAD
    assert evaluate(shifted, truth)["pelvis.rotation"].rmse < SPLINE_RAD


def test_unobserved_and_unknown_joints_say_so(track, truth):
    observed = track.observed.copy()
    observed[:, 9] = False
    q = truth.q.copy()
    q[:, 4] = np.nan
    evaluation = evaluate(replace(track, observed=observed), replace(truth, q=q))
    assert (evaluation["shoulder"].note, evaluation["pelvis.rotation"].note) == ("not observed", "no truth")
    assert evaluation["pelvis.position"].observed
    other = true_track(BallBody({"shoulder": "hinge"}), 40.0)
    assert evaluate(track, other)["shoulder"].note == "no truth"


def test_means_take_hinges_and_whole_rotations(truth):
    error = np.zeros(12)
    error[6], error[11], error[SHOULDER] = 0.01, 0.02, (0.03, 0.0, 0.0)
    evaluation = evaluate(moved(truth, error), truth)
    assert [s.name for s in evaluation.turning()] == ["pelvis.rotation", "trunk", "shoulder", "elbow"]
    assert [s.name for s in evaluation.hinges()] == ["trunk", "elbow"]
    assert evaluation.mean_rmse_deg() == pytest.approx(np.degrees(0.06 / 4))
    assert evaluation.worst_rmse_deg() == pytest.approx(np.degrees(0.03))


def tangent_covariance() -> np.ndarray:
    """Full, over 12 coordinates and their rates; units differ."""
    scale = np.repeat([0.02, 0.3, 4.0], 12)
    related = 0.6 ** np.abs(np.subtract.outer(np.arange(36), np.arange(36)))
    return related * np.outer(scale, scale)


def test_nees_on_the_manifold_is_one_for_a_consistent_belief(track, truth):
    believed = with_beliefs(track, truth, tangent_covariance(), every=5, seed=4)
    states = evaluate(believed, truth).states
    assert states.degrees == states.beliefs * 36
    # the error is drawn at the truth and judged at the mean: second order, 0.02 squared
    assert abs(states.nees - 1) < FIVE_SIGMA * np.sqrt(2 / states.degrees) + 0.02**2 * 10


def test_nees_needs_the_sign_of_the_error(track, truth):
    """Correlated with its rate, a turn the other way round would be judged far too improbable."""
    believed = with_beliefs(track, truth, tangent_covariance(), every=5, seed=4)
    mean = believed.beliefs.mean.copy()
    for columns in ([3, 4, 5], [8, 9, 10]):
        true, found = truth.q[::5, columns], mean[:, columns]
        turn = quat_product(quat_inverse(quat_from_rotvec(found)), quat_from_rotvec(true))
        mean[:, columns] = rotvec_from_quat(quat_product(quat_from_rotvec(true), turn))
    wrong = replace(believed, beliefs=replace(believed.beliefs, mean=mean))
    assert evaluate(wrong, truth).states.nees > 1.1  # a consistent one ends at 1.02


def test_dictionary_is_json_and_holds_the_parts(track, truth):
    read = json.loads(json.dumps(evaluate(track, truth).to_dict(), allow_nan=False))
    assert read["joints"]["shoulder"]["parts"]["shoulder.rx"]["rmse_rad"] > 0
    assert "parts" not in read["joints"]["trunk"]


def test_tables_name_every_part(track, truth, capsys):
    evaluation = evaluate(track, truth)
    shown = str(evaluation)
    assert "pelvis.position" in shown and "shoulder YXY y1" in shown
    write_evaluation(evaluation)
    printed = capsys.readouterr().out
    for text in ("pelvis.rotation", "shoulder.rx", "shoulder YXY x", "mean RMSE of hinges and rotations"):
        assert text in printed
    assert max(map(len, printed.splitlines())) <= 100


# --- orientations of frames ---------------------------------------------------------------------------


def turned(track, angle_rad, error=(0.0, 0.0, 0.0)) -> oarlock.Track:
    """The whole body turned about the vertical (y), its shoulder off by an error in the upper arm's axes."""
    q = track.q.copy()
    about_up = quat_from_rotvec([0.0, angle_rad, 0.0])
    q[:, 3:6] = rotvec_from_quat(quat_product(about_up, quat_from_rotvec(q[:, 3:6])))
    q[:, SHOULDER] = rotvec_from_quat(quat_product(quat_from_rotvec(q[:, SHOULDER]), quat_from_rotvec(error)))
    return replace(track, q=q)


def test_a_heading_is_no_inclination(truth):
    scores = evaluate_frame_orientations(turned(truth, 0.4), truth)
    assert [s.frame for s in scores.frames] == ["pelvis", "thorax", "collar", "upperarm", "forearm", "hand"]
    for score in scores.frames:
        assert score.rmse_rad == pytest.approx(0.4, abs=EXACT)
        assert score.heading_rmse_rad == pytest.approx(0.4, abs=EXACT)
        assert score.inclination_rmse_rad == pytest.approx(0.0, abs=EXACT)
        assert score.worst_rad == pytest.approx(0.4, abs=EXACT)
    assert scores.removed_heading_rad is None


@pytest.mark.parametrize("angle", [0.4, -2.9, 3.1])
def test_one_heading_can_be_removed(truth, angle):
    scores = evaluate_frame_orientations(turned(truth, angle, (0.02, 0.0, 0.0)), truth, remove_heading=True)
    assert scores["thorax"].rmse_rad == pytest.approx(0.0, abs=0.02)
    # the shoulder's own error has some heading, which the mean of all frames takes a part of
    assert scores.removed_heading_rad == pytest.approx(angle, abs=0.02)
    free = evaluate_frame_orientations(turned(truth, angle), truth, remove_heading=True)
    assert free.removed_heading_rad == pytest.approx(angle, abs=EXACT)
    assert max(s.rmse_rad for s in free.frames) < 1e-8


def test_the_heading_is_the_best_one(track, truth):
    def squares(offset):
        scores = evaluate_frame_orientations(turned(track, offset), truth)
        return sum(s.samples * 4 * np.sin(s.rmse_rad / 2) ** 2 for s in scores.frames)

    best = evaluate_frame_orientations(track, truth, remove_heading=True).removed_heading_rad
    assert squares(-best) < min(squares(-best - 0.01), squares(-best + 0.01))


def test_relative_orientations_need_no_heading(truth):
    scores = evaluate_frame_orientations(turned(truth, 1.0, (0.0, 0.03, 0.0)), truth, relative_to="collar")
    assert "collar" not in [s.frame for s in scores.frames]
    assert scores["upperarm"].rmse_rad == pytest.approx(0.03, abs=EXACT)
    assert scores["thorax"].rmse_rad == pytest.approx(0.0, abs=EXACT)
    assert np.isnan(scores["upperarm"].heading_rmse_rad)
    assert json.loads(json.dumps(scores.to_dict(), allow_nan=False))["relative_to"] == "collar"
    with pytest.raises(oarlock.DataError, match="no heading to remove"):
        evaluate_frame_orientations(truth, truth, relative_to="collar", remove_heading=True)


def measured(truth, **names) -> Reference:
    """What cameras with z up, x along the model's forward, see: columns x, y, z of the model are y, z, x of theirs."""
    world_from_root = quat_inverse(np.array([0.5, -0.5, -0.5, -0.5]))
    quats = {
        body: quat_product(world_from_root, truth.frame_quat_wxyz(frame)) for body, frame in names.items()
    }
    return Reference("optical", truth.time_s, quats)


def test_another_systems_world_has_z_up_and_x_forward(truth):
    reference = measured(truth, arm="upperarm", hand="hand")
    scores = evaluate_frame_orientations(truth, reference, {"upperarm": "arm", "hand": "hand"})
    assert scores.reference == "optical"
    assert max(s.rmse_rad for s in scores.frames) < 1e-8
    assert [s.frame for s in evaluate_frame_orientations(truth, reference).frames] == ["hand"]
    relative = evaluate_frame_orientations(
        turned(truth, 1.0), reference, {"hand": "hand", "upperarm": "arm"}, relative_to="upperarm"
    )
    assert [s.frame for s in relative.frames] == ["hand"]
    assert relative["hand"].rmse_rad < 1e-8


def test_gaps_and_marks_of_the_reference_are_kept(truth):
    whole = measured(truth, hand="hand")
    quat = whole.quat_wxyz["hand"].copy()
    quat[500:700] = np.nan
    scored = np.ones(len(truth.time_s), dtype=bool)
    scored[:1000] = False
    holed = Reference("optical", truth.time_s, {"hand": quat}, scored=scored)
    assert evaluate_frame_orientations(truth, holed)["hand"].samples == len(truth.time_s) - 1000
    gaps = Reference("optical", truth.time_s, {"hand": quat})
    assert evaluate_frame_orientations(truth, gaps)["hand"].samples == len(truth.time_s) - 100 - 200


def test_a_window_ends_where_it_is_told(truth):
    scores = evaluate_frame_orientations(truth, truth, ["hand"], start_s=1.0, end_s=3.0)
    assert scores["hand"].samples == scores.samples == 101


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"frames": ["hnd"]}, "no frame 'hnd'.*hand"),
        ({"frames": {"hand": "palm"}}, "optical reference has no body 'palm'.*arm"),
        ({"frames": None}, "no frame of the model"),
        ({"frames": {"upperarm": "arm"}, "start_s": 99.0}, "no sample from 99.000"),
    ],
    ids=["frame", "body", "nothing", "window"],
)
def test_what_cannot_be_compared_is_explained(truth, asked, said):
    with pytest.raises(oarlock.DataError, match=said):
        evaluate_frame_orientations(truth, measured(truth, arm="upperarm"), **asked)


# --- report -------------------------------------------------------------------------------------------


def test_a_report_draws_named_angles_and_says_where_they_are_singular(tmp_path, track, truth):
    read = Page(write_page(track, tmp_path, truth=truth).read_text(encoding="utf-8"))
    assert read.errors == []
    drawn = read.all("figure")
    assert len(drawn) == 3 + 3 + 1 + 1 + 3 + 1
    angles = ("shoulder YXY y1", "pelvis.rotation ZXY x", "pelvis.x")
    for text in (*angles, "within 15 deg of a pole", "of its mean"):
        assert text in read.text
    assert "5 of 5" in read.text
    assert any("singular-span" in (a.get("class") or "") for a in read.all("rect"))
    assert "4 joints" in read.text


def test_a_report_of_a_ball_alone_and_without_truth(tmp_path):
    truth = true_track(BallBody({"shoulder": "ball"}), 5.0)
    for track, options in ((noisy(truth, 0.02), {}), (noisy(truth, 0.02), {"truth": truth}), (truth, {})):
        read = Page(write_page(track, tmp_path, **options).read_text(encoding="utf-8"))
        assert read.errors == []
        assert "shoulder YXY x" in read.text


def test_a_report_of_a_body_that_only_slides(tmp_path):
    truth = true_track(BallBody({"rail": "slide"}), 5.0)
    read = Page(write_page(noisy(truth, 0.02), tmp_path, truth=truth).read_text(encoding="utf-8"))
    assert read.errors == []
    assert "No observed hinge or rotation" in read.text
