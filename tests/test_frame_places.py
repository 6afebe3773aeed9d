"""Places of frames with the lengths that were estimated, and their standard deviations."""

from dataclasses import replace

import numpy as np
import pytest

import oarlock
import test_worn_states
from oarlock import Config
from oarlock.simulation import Motion
from oarlock.tracking.records import Beliefs
from oarlock.tracking.track import track_without_filter
from refusals import assert_refused

TIME_S, SWING = test_worn_states.TIME_S[:601], test_worn_states.SWING[:601]
"""Twelve seconds."""
LENGTH = "l_upper"
TREE = Config(structure="tree", estimate=("gyro_bias", "accel_bias", LENGTH))
LONGER_M = 0.03
ROUNDING_M = 1e-9
"""Places are linear in lengths; the slope is a difference of numbers near 1."""
DRAWS = 20_000
SAMPLING = 0.06
"""Of a covariance from so many draws: six times sqrt(2 / 20000)."""


@pytest.fixture(scope="module")
def stretched(pendulum: oarlock.Model) -> oarlock.Track:
    """Tracked with one length unknown, which truly is 30 mm more than the model says."""
    longer = oarlock.Calibration(parameters={LENGTH: pendulum.parameters[LENGTH] + LONGER_M})
    motion = Motion(tuple(pendulum.joint_names), TIME_S, SWING)
    recording = oarlock.simulate(pendulum, motion, seed=3, calibration=longer)[1]
    return oarlock.track(pendulum, recording, config=TREE)


def last_frame(track: oarlock.Track) -> str:
    assert track.model is not None
    return track.model.frame_names[-1]


def test_places_take_the_length_of_each_sample(stretched, pendulum):
    found = stretched.slow[f"parameters.{LENGTH}"].value
    # the estimate moved away from the model's, or the test would show nothing
    assert abs(found[-1] - pendulum.parameters[LENGTH]) > 0.5 * LONGER_M
    places = stretched.frame_positions(last_frame(stretched))
    for row in (0, 200, len(stretched) - 1):
        sized = oarlock.load_model("pendulum3", parameters={LENGTH: float(found[row])})
        pose = sized.forward_kinematics(stretched.q[row])[-1]
        np.testing.assert_allclose(places[row], pose[:3, 3], rtol=0, atol=ROUNDING_M)


def test_a_loaded_track_has_the_same_places_and_deviations(stretched, tmp_path):
    stretched.save(tmp_path / "track")
    loaded = oarlock.load_track(tmp_path / "track")
    frame = last_frame(stretched)
    assert np.array_equal(loaded.frame_positions(frame), stretched.frame_positions(frame))
    assert np.array_equal(loaded.frame_position_stds(frame), stretched.frame_position_stds(frame))


@pytest.mark.parametrize("reference", ["root", "middle"])
def test_deviations_are_those_of_draws_from_the_belief(stretched, pendulum, reference):
    beliefs = stretched.beliefs
    frame = last_frame(stretched)
    reference = reference if reference in pendulum.frame_names else pendulum.frame_names[1]
    spread = stretched.frame_position_spread(frame, reference)
    assert spread.source == "beliefs"
    k = len(beliefs.time_s) - 1
    row = int(np.argmin(np.abs(stretched.time_s - beliefs.time_s[k])))
    names = [*stretched.coordinate_names, f"parameters.{LENGTH}"]
    columns = [beliefs.state_names.index(name) for name in names]
    std = np.append(stretched.q_std[row], stretched.slow[names[-1]].std[row])
    own = beliefs.covariance[k][np.ix_(columns, columns)]
    scale = std / np.sqrt(np.diag(own))
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(4), own * np.outer(scale, scale), DRAWS)
    whole = replace(
        stretched,
        time_s=np.arange(DRAWS, dtype=float),
        q=stretched.q[row] + draws[:, :3],
        slow={
            names[-1]: replace(
                stretched.slow[names[-1]], value=stretched.slow[names[-1]].value[row] + draws[:, 3]
            )
        },
    )
    drawn = np.cov(whole.frame_positions(frame, reference).T)
    size = np.linalg.norm(drawn)
    np.testing.assert_allclose(spread.covariance_m2[row], drawn, rtol=0, atol=SAMPLING * size)
    np.testing.assert_allclose(spread.std_m[row] ** 2, np.diag(spread.covariance_m2[row]))


def test_without_beliefs_joints_are_independent_and_it_says_so(stretched):
    frame = last_frame(stretched)
    alone = replace(stretched, beliefs=None).frame_position_spread(frame)
    assert alone.source == "deviations"
    eye = np.tile(np.eye(len(stretched.beliefs.state_names)), (len(stretched.beliefs.time_s), 1, 1))
    plain = Beliefs(stretched.beliefs.time_s, stretched.beliefs.mean, eye, stretched.beliefs.state_names)
    same = replace(stretched, beliefs=plain).frame_position_spread(frame)
    np.testing.assert_allclose(alone.covariance_m2, same.covariance_m2, rtol=1e-9, atol=1e-20)


def test_what_no_filter_made_has_no_deviations(pendulum):
    truth = oarlock.simulate(pendulum, Motion(tuple(pendulum.joint_names), TIME_S, SWING), seed=0)[0]
    spread = truth.frame_position_spread(pendulum.frame_names[-1])
    assert spread.source == "unknown" and np.isnan(spread.std_m).any(axis=1).all()
    # the root does not move, whatever is unknown
    assert np.all(truth.frame_position_stds("root") == 0.0)


def test_a_ball_joint_moves_places_by_small_turns():
    model = oarlock.load_model("sculler_ball")
    rng = np.random.default_rng(2)
    q = 0.3 * rng.standard_normal((3, len(model.coordinate_names)))
    truth = track_without_filter(model, np.arange(3.0), q, provenance={"config": {"structure": "tree"}})
    told = replace(truth, q_std=np.full(q.shape, 1e-3))
    stds = told.frame_position_stds("r_elbow", relative_to="r_shoulder")
    # turns of 1 mrad about two axes across an upper arm: 0.315 mm across it, in any direction of the two
    np.testing.assert_allclose(np.sqrt((stds**2).sum(axis=1)), 1e-3 * 0.315 * np.sqrt(2.0), rtol=1e-3)


def test_odd_frames_are_refused(stretched):
    assert_refused(lambda: stretched.frame_position_stds("uper"), "frame_position_spread: no frame 'uper'")
    assert_refused(lambda: replace(stretched, model=None).frame_position_stds("root"), "without its model")
