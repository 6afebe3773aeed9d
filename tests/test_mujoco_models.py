"""An independent simulator: MuJoCo, built from what a model file describes, feels what Oarlock's simulator feels."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import oarlock
from exact_recording import Floats
from mujoco_body import MujocoBody, recorded
from oarlock.rowing import sculling
from random_tree import waves

STEP_S = 2e-3
"""Spacing of the nine poses that the simulator differentiates."""
REACH_M = 2.5
"""No sensor of these bodies is further from a joint that moves it."""
# Central differences of eighth order, for 1, 2, 3 and 4 steps.
FIRST = np.array([4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0])
SECOND = np.array([8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0])
ROUNDING = 4.0 * np.finfo(float).eps
"""Relative error of a pose behind a dozen links."""
NEVER_MORE = (1e-9, 1e-6)
"""rad/s and m/s2: what `test_simulate` grants between the simulator and the engine's own readings."""
MODELS = ("sculler", "sculler_ball", "arm7", "pendulum3", "diodem_arm", "qmt_full_body")


def of_a_kink(weights: Floats) -> float:
    """What differences make at most of a fifth derivative that jumps by 1 somewhere within reach, in steps."""
    begins = np.linspace(0.0, 4.0, 401)[:, None]
    return float(np.abs(np.maximum(np.arange(1.0, 5.0) - begins, 0.0) ** 5 / 120.0 @ weights).max())


def differentiation_accuracy(motion: oarlock.simulation.Motion) -> tuple[float, float]:
    """By how much differences of a motion's poses may miss its rates: rad/s and m/s2.

    Quintic splines jump in their fifth derivative at the knots, which differences cannot see through. Several knots lie
    within reach of them; each joint's jump moves a sensor by at most the reach, and rates of several joints multiply,
    hence the factor 2. Steps of 2 ms are too small for anything else but rounding to matter.
    """
    fifth = make_interp_spline(motion.time_s, motion.q, k=5).derivative(5)
    jumps = np.abs(np.diff(fifth(motion.time_s[:-1] + 1e-9), axis=0)).max(axis=0).sum()
    knots = 8.0 * STEP_S / np.diff(motion.time_s).min() + 1.0
    turns = 2.0 * knots * jumps * STEP_S**4 * of_a_kink(FIRST) + ROUNDING * 2.0 * np.abs(FIRST).sum() / STEP_S
    moves = (
        2.0 * knots * jumps * STEP_S**3 * of_a_kink(SECOND)
        + ROUNDING * 4.0 * np.abs(SECOND).sum() / STEP_S**2
    )
    return float(turns), float(REACH_M * moves)


def assert_agree(model: oarlock.Model, motion: oarlock.simulation.Motion, every: int) -> None:
    body = MujocoBody(model.describe())
    truth, recording = oarlock.simulate(model, motion, noise=False)
    rows = np.arange(0, len(truth.time_s), every)
    base = motion.base_acceleration_at(truth.time_s)
    expected = np.stack([body.readings(truth.q[r], truth.qd[r], truth.qdd[r], base[r]) for r in rows])
    found = recorded(recording, [unit.name for unit in body.units])[rows]
    turns, moves = differentiation_accuracy(motion)
    apart = np.abs(found - expected).max(axis=(0, 1, 3))
    print(f"{model.name}: apart {apart[0]:.1e} of {turns:.1e} rad/s, {apart[1]:.1e} of {moves:.1e} m/s2")
    assert apart[0] <= min(turns, NEVER_MORE[0])
    assert apart[1] <= min(moves, NEVER_MORE[1])
    measured = [u.mag_std_ut is not None for u in body.units]
    # Nothing is differentiated for a field of 50 uT: only poses are rounded.
    assert np.abs(found - expected)[:, measured, 2].max(initial=0.0) <= 100.0 * 50.0 * ROUNDING


@pytest.mark.parametrize("name", MODELS)
def test_mujoco_feels_what_the_simulator_feels(name):
    model = oarlock.load_model(name)
    assert_agree(model, waves(model), every=5)


def test_mujoco_feels_the_same_while_sculling():
    model = oarlock.load_model("sculler")
    assert_agree(model, sculling(model, 6.0, (20.0, 34.0), seed=4), every=5)


def test_the_models_hold_what_could_go_wrong():
    """Every kind of joint, shared and negated joints, transforms on both sides of a joint."""
    descriptions = [oarlock.load_model(name).describe() for name in MODELS]
    kinds = {joint.kind for d in descriptions for joint in d.joints}
    assert kinds == {"hinge", "slide", "ball", "free"}
    frames = [frame for d in descriptions for frame in d.frames if frame.joint]
    assert {1.0, -1.0} == {frame.sign for frame in frames}
    assert any(frame.before and frame.after for frame in frames)
    trunk = [frame.name for frame in descriptions[0].frames if frame.joint == "trunk"]
    assert trunk == ["r_shoulder", "l_shoulder"]


def test_a_wrong_sign_is_noticed():
    """The comparison can fail: with one joint negated MuJoCo feels something else."""
    model = oarlock.load_model("arm7")
    description = model.describe()
    negated = (replace(f, sign=-1.0) if f.joint == "shoulder_flexion" else f for f in description.frames)
    motion = waves(model)
    truth, recording = oarlock.simulate(model, motion, noise=False)
    body = MujocoBody(replace(description, frames=tuple(negated)))
    there = body.readings(
        truth.q[50], truth.qd[50], truth.qdd[50], motion.base_acceleration_at(truth.time_s[50])
    )
    found = recorded(recording, [unit.name for unit in body.units])[50]
    assert np.abs(found - there)[:, 1].max() > 0.1
