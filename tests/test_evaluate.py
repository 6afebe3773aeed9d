"""Scores against closed forms on tracks made by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fake_track import FakeModel, noisy_track, true_track, with_beliefs
from oarlock.evaluation.errors import landmark_frames, wrap
from oarlock.evaluation.evaluate import evaluate
from oarlock.evaluation.resample import resample
from oarlock.storage.errors import DataError

EXACT = 1e-12
"""Rounding only."""
FIVE_SIGMA = 5.0
"""Statistical bounds: a right result leaves them once in two million draws."""
SPLINE_RAD = 2e-6
"""Cubic spline of a 0.8 Hz sine sampled at 100 Hz: (w h)^4 5/384 of its amplitude, w h = 0.05; ends are worse."""

NAMES, UNITS = ("seat", "elbow", "wrist"), ("m", "rad", "rad")
TIME_S = np.arange(4001) * 0.01


@pytest.fixture
def truth():
    return true_track(TIME_S, NAMES, UNITS)


def test_constant_offset_is_the_rmse_and_the_bias(truth):
    track = replace(noisy_track(truth, 0.01), q=truth.q + 0.01)
    evaluation = evaluate(track, truth)
    score = evaluation["elbow"]
    assert score.rmse == pytest.approx(0.01, abs=EXACT)
    assert score.bias == pytest.approx(0.01, abs=EXACT)
    assert score.correlation == pytest.approx(1.0, abs=EXACT)
    assert score.nees == pytest.approx(1.0, abs=1e-9)
    assert score.coverage == 1.0
    # Presented in degrees and millimetres.
    seat, elbow, _ = evaluation.rows
    assert (seat["unit"], elbow["unit"]) == ("mm", "deg")
    assert (seat["rmse"], elbow["rmse"]) == pytest.approx((10.0, np.degrees(0.01)))


def test_gaussian_errors_are_covered_and_consistent(truth):
    track = noisy_track(truth, 0.02, seed=3)
    evaluation = evaluate(track, truth)
    n = evaluation.samples
    for score in evaluation.joints:
        assert abs(score.rmse / 0.02 - 1) < FIVE_SIGMA / np.sqrt(2 * n)
        assert abs(score.bias) < FIVE_SIGMA * 0.02 / np.sqrt(n)
        assert abs(score.coverage - 0.95) < FIVE_SIGMA * np.sqrt(0.95 * 0.05 / n)
        assert abs(score.nees - 1) < FIVE_SIGMA * np.sqrt(2 / n)


def test_a_track_that_claims_half_its_error_is_found_out(truth):
    score = evaluate(noisy_track(truth, 0.02, seed=3, claimed=0.01), truth)["elbow"]
    n = len(TIME_S) - 200
    expected = 0.6729  # P(|z| < 0.98)
    assert abs(score.coverage - expected) < FIVE_SIGMA * np.sqrt(expected * (1 - expected) / n)
    assert abs(score.nees - 4) < FIVE_SIGMA * 4 * np.sqrt(2 / n)


def test_settling_time_counts_from_the_first_stamp(truth):
    late = replace(truth, time_s=TIME_S + 1.7e9)
    track = noisy_track(late, 0.01)
    spoilt = track.q.copy()
    spoilt[:200] += 1.0
    evaluation = evaluate(replace(track, q=spoilt), late, start_s=2.0)
    assert evaluation.samples == len(TIME_S) - 200
    assert evaluation["seat"].rmse < 0.02


def test_hinges_wrap_and_slides_do_not(truth):
    turned = truth.q + 2 * np.pi
    track = replace(noisy_track(truth, 0.01), q=turned)
    evaluation = evaluate(track, truth)
    assert evaluation["elbow"].rmse == pytest.approx(0.0, abs=1e-9)
    assert evaluation["elbow"].correlation == pytest.approx(1.0, abs=EXACT)
    assert evaluation["seat"].rmse == pytest.approx(2 * np.pi, abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "expected"), [(np.pi, np.pi), (-np.pi, np.pi), (0.0, 0.0), (3.5, 3.5 - 2 * np.pi)]
)
def test_wrap_keeps_plus_pi_and_drops_minus_pi(angle, expected):
    assert wrap(np.array([angle]))[0] == pytest.approx(expected, abs=EXACT)


def test_truth_at_other_stamps_is_interpolated(truth):
    shifted = TIME_S[:-1] + 0.0037
    track = noisy_track(true_track(shifted, NAMES, UNITS), 1e-3)
    exact = replace(track, q=true_track(shifted, NAMES, UNITS).q)
    assert all(score.rmse < SPLINE_RAD for score in evaluate(exact, truth).joints)


def test_interpolation_copies_coincident_stamps_and_never_leaves_the_range():
    time_s, value = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 8.0, 27.0])
    at_s = np.array([-0.1, 0.0, 1.0 + 5e-10, 1.5, 3.0, 3.1])
    result = resample(time_s, value, at_s)
    assert np.isnan(result[[0, 5]]).all()
    assert result[[1, 2, 4]].tolist() == [0.0, 1.0, 27.0]
    assert result[3] == pytest.approx(1.5**3, abs=EXACT)  # a not-a-knot spline reproduces cubics


def test_interpolation_leaves_gaps_open():
    time_s = np.arange(10.0)
    value = np.where((time_s > 3) & (time_s < 7), np.nan, time_s)
    result = resample(time_s, value, np.array([2.5, 3.5, 5.0, 6.5, 7.5]))
    assert np.isnan(result).tolist() == [False, True, True, True, False]


def test_interpolation_of_wrapped_angles_does_not_cross_the_circle():
    time_s = np.linspace(0.0, 2.0, 41)
    at_s = time_s[:-1] + 0.02
    result = resample(time_s, wrap(4.0 * time_s), at_s, circular=True)
    np.testing.assert_allclose(wrap(result - 4.0 * at_s), 0.0, atol=1e-9)


def test_truth_stamps_out_of_order_are_refused(truth):
    broken = TIME_S.copy()
    broken[7] = broken[6]
    with pytest.raises(DataError, match=r"not increasing: 0\.060000 s is followed by 0\.060000 s"):
        evaluate(noisy_track(truth, 0.01), replace(truth, time_s=broken))


def test_no_overlap_is_refused(truth):
    with pytest.raises(DataError, match="do not overlap"):
        evaluate(noisy_track(truth, 0.01), replace(truth, time_s=TIME_S + 100))
    with pytest.raises(DataError, match="smaller start_s"):
        evaluate(noisy_track(truth, 0.01), truth, start_s=50.0)


def test_joints_without_observation_or_truth_are_named_and_not_scored(truth):
    track = noisy_track(truth, 0.01)
    observed = track.observed.copy()
    observed[: int(0.6 * len(TIME_S)), 1] = False
    blind = truth.q.copy()
    blind[:, 2] = np.nan
    evaluation = evaluate(replace(track, observed=observed), replace(truth, q=blind))
    assert (evaluation["elbow"].observed, evaluation["elbow"].note) == (False, "not observed")
    assert (evaluation["wrist"].observed, evaluation["wrist"].note) == (False, "no truth")
    assert np.isnan(evaluation["elbow"].rmse)
    assert np.isnan(evaluation.mean_rmse_deg())
    assert "not observed" in evaluation.table()[2]


def test_constant_signal_has_no_correlation_and_says_so(truth):
    still = truth.q.copy()
    still[:, 1] = 0.3
    evaluation = evaluate(noisy_track(truth, 0.01), replace(truth, q=still))
    assert np.isnan(evaluation["elbow"].correlation)
    assert evaluation.rows[1]["note"] == "constant"


def test_track_without_bands_has_errors_but_no_coverage(truth):
    track = replace(noisy_track(truth, 0.01), q_std=np.full(truth.q.shape, np.nan))
    score = evaluate(track, truth)["elbow"]
    assert score.rmse > 0
    assert np.isnan(score.coverage)
    assert np.isnan(score.nees)


def test_mean_rmse_takes_hinges_by_name(truth):
    offsets = np.array([0.5, 0.01, 0.03])
    evaluation = evaluate(replace(noisy_track(truth, 0.01), q=truth.q + offsets), truth)
    assert evaluation.mean_rmse_deg() == pytest.approx(np.degrees(0.02))
    assert evaluation.mean_rmse_deg(["wrist"]) == pytest.approx(np.degrees(0.03))
    assert evaluation.worst_rmse_deg() == pytest.approx(np.degrees(0.03))
    with pytest.raises(KeyError, match="no joint 'knee'"):
        evaluation.mean_rmse_deg(["knee"])


def test_positions_by_axis_and_in_space(truth):
    moved = {name: xyz + np.array([0.003, 0.0, 0.004]) for name, xyz in truth.positions.items()}
    evaluation = evaluate(replace(noisy_track(truth, 0.01), positions=moved), truth)
    assert [score.frame for score in evaluation.positions] == ["r_shoulder", "r_wrist"]
    wrist = evaluation.positions[1]
    assert wrist.rmse_m == pytest.approx(0.005, abs=EXACT)
    assert wrist.axis_rmse_m == pytest.approx((0.003, 0.0, 0.004), abs=EXACT)
    assert wrist.axis_correlation[0] == pytest.approx(1.0, abs=EXACT)
    assert np.isnan(wrist.axis_correlation[2])
    assert np.isnan(wrist.coverage)


@pytest.mark.parametrize(("std_m", "share"), [(0.0021, 1.0), (0.0016, 2 / 3), (0.001, 1 / 3)])
def test_coverage_of_positions_counts_single_axes(truth, std_m, share):
    moved = {name: xyz + np.array([0.003, 0.0, 0.004]) for name, xyz in truth.positions.items()}
    track = replace(noisy_track(truth, 0.01), positions=moved, position_std_m=std_m)
    assert evaluate(track, truth).positions[1].coverage == pytest.approx(share)


def test_frames_default_to_the_ends_of_the_tree(truth):
    chain = replace(truth, model=FakeModel(("root", "link", "tip_a", "tip_b"), (-1, 0, 1, 1)))
    assert landmark_frames(chain, chain) == ("tip_a", "tip_b")
    assert landmark_frames(replace(chain, model=None), chain) == ()


def correlated(states: int) -> np.ndarray:
    """A full covariance over states whose units differ by orders of magnitude."""
    scale = np.tile([1e-3, 1e-1, 10.0], states // 3)
    correlation = 0.6 ** np.abs(np.subtract.outer(np.arange(states), np.arange(states)))
    return correlation * np.outer(scale, scale)


@pytest.mark.parametrize("known", [9, 6])
def test_nees_per_state_uses_the_full_covariance_of_what_truth_knows(truth, known):
    track = with_beliefs(noisy_track(truth, 0.01), truth, correlated(9), every=10, seed=5)
    states = evaluate(
        track, truth if known == 9 else replace(truth, qdd=np.full(truth.q.shape, np.nan))
    ).states
    assert states.degrees == states.beliefs * known
    assert abs(states.nees - 1) < FIVE_SIGMA * np.sqrt(2 / states.degrees)
    assert states.interval_95[0] < 1 < states.interval_95[1]


def test_beliefs_a_turn_away_are_the_same_angle(truth):
    track = with_beliefs(noisy_track(truth, 0.01), truth, correlated(9), every=10, seed=5)
    turned = track.beliefs.mean.copy()
    turned[:, track.beliefs.state_names.index("elbow")] += 2 * np.pi
    away = replace(track, beliefs=replace(track.beliefs, mean=turned))
    assert evaluate(away, truth).states.nees == pytest.approx(evaluate(track, truth).states.nees, abs=1e-9)


def test_singular_beliefs_are_counted_and_left_out(truth):
    track = with_beliefs(noisy_track(truth, 0.01), truth, correlated(9), every=100, seed=5)
    covariance = track.beliefs.covariance.copy()
    covariance[-1] = 1.0
    states = evaluate(replace(track, beliefs=replace(track.beliefs, covariance=covariance)), truth).states
    assert states.singular == 1
    assert states.degrees == states.beliefs * 9


def test_nis_per_measurement_of_each_sensor(truth):
    scores = {score.name: score for score in evaluate(noisy_track(truth, 0.01), truth).sensors}
    n = len(TIME_S) - 200
    assert (scores["back"].count.used, scores["seat"].count.used) == (9 * len(TIME_S) - 10, len(TIME_S) - 10)
    assert scores["r_grip"].count is None
    rows = {"back": 9 * n, "seat": n, "r_grip": 3 * n, "all inertial": 9 * n}
    for name, score in scores.items():
        assert abs(score.nis - 1) < FIVE_SIGMA * np.sqrt(2 / rows[name])
        assert score.interval_95[0] < 1 < score.interval_95[1]


def test_truth_has_no_sensors_and_no_beliefs(truth):
    evaluation = evaluate(truth, truth)
    assert evaluation.sensors == ()
    assert evaluation.states is None
    assert evaluation["elbow"].rmse == 0.0


def test_dictionary_is_json_without_nan(truth):
    track = with_beliefs(noisy_track(truth, 0.01), truth, correlated(9), every=100)
    track = replace(track, q_std=np.full(truth.q.shape, np.nan))
    text = json.dumps(evaluate(track, truth).to_dict(), allow_nan=False)
    read = json.loads(text)
    assert read["joints"]["elbow"]["coverage_95"] is None
    assert read["joints"]["seat"]["rmse_m"] > 0
    assert read["states"]["beliefs"] > 0
