"""Sessions for persons: units that move as one, steps in any order, optional steps, parts of a body."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock.calibration import SessionPlan, SessionStep
from oarlock.simulation import SessionErrors
from refusals import assert_refused

ANY_ROTATION = SessionErrors(mount_rad=2.5)
MEAN_MOUNT_DEG, RMSE_DEG = 4.0, 4.0
COVERAGE = (0.85, 1.0)
"""Bands of strapdown links contain skin, which these units have none of."""
POSTURE_STD_RAD = np.radians(1.0)
"""Of a posture that somebody corrects; the plan states the same."""
IN_THE_FIELD = replace(
    ANY_ROTATION, posture_rad=0.0, segment_rad=POSTURE_STD_RAD, skin_rad=np.radians(2.0) / np.radians(90.0)
)
"""Skin as in the field simulator: a unit tilts by 2 deg while a joint turns by 90 deg."""


def without_optional(plan):
    return replace(plan, steps=tuple(step for step in plan.steps if not step.optional))


def session(name, seed):
    model = oarlock.load_model(name)
    plan = without_optional(oarlock.calibration.default_plan(model))
    trial = oarlock.simulation.simulate_session(model, plan, ANY_ROTATION, seed=seed)
    return model, trial, oarlock.calibration.calibrate_session(model, trial.recording)


def mean_mount_deg(trial, found):
    turns = [found.mounts[u][0] @ trial.calibration.mounts[u][0].T for u in trial.calibration.mounts]
    return float(np.degrees(Rotation.from_matrix(np.array(turns)).magnitude()).mean())


@pytest.fixture(scope="module")
def legs():
    return session("lower_body", 0)


def test_mounts_of_any_rotation_without_optional_steps(legs):
    _, trial, found = legs
    assert mean_mount_deg(trial, found) < MEAN_MOUNT_DEG
    assert found.noted["session"]["passed"]
    kept = [step for step in found.noted["session"]["step"] if step["name"] == "knee bends"]
    assert kept[0]["outcome"] == "kept" and "it is optional" in kept[0]["sentence"]


def test_steps_in_another_order_are_found(legs):
    model, _, _ = legs
    plan = without_optional(oarlock.calibration.default_plan(model))
    first, *moves, last = plan.steps
    mixed = replace(plan, steps=(first, *reversed(moves), last))
    trial = oarlock.simulation.simulate_session(model, mixed, ANY_ROTATION, seed=1)
    found = oarlock.calibration.calibrate_session(model, trial.recording)
    placed = {s["name"]: s for s in found.noted["session"]["step"] if "start_s" in s}
    for step in moves:
        start, end = trial.spans[step.name]
        assert placed[step.name]["start_s"] < 0.5 * (start + end) < placed[step.name]["end_s"]


def test_a_part_has_no_units_and_joints_that_it_lacks():
    plan = oarlock.calibration.default_plan(oarlock.load_model("lower_body"))
    assert {unit for step in plan.steps for unit in step.units} == {"shank_r", "foot_r", "shank_l", "foot_l"}
    assert "arm swing" not in [step.name for step in plan.steps]
    assert plan.any_order


def test_a_plan_with_the_new_keys_is_a_file(tmp_path):
    step = SessionStep("swing", "move", joints=("hip_flexion_r",), units=("shank_r",), optional=True)
    plan = SessionPlan("mine", (step,), any_order=True)
    plan.save(tmp_path / "plan.toml")
    assert oarlock.calibration.load_session_plan(tmp_path / "plan.toml") == plan


def test_values_of_wrong_types():
    move = {"name": "swing", "kind": "move", "joints": ("hip",)}
    assert_refused(lambda: SessionStep(**move, optional="yes"), "optional", "expected true or false")
    assert_refused(lambda: SessionStep(**move, units=3), "units")
    step = SessionStep(**move)
    assert_refused(lambda: SessionPlan("mine", (step,), any_order=1), "any_order", "expected true or false")


def test_the_upper_body_passes_without_optional_steps():
    model = oarlock.load_model("upper_body")
    trial = oarlock.simulation.simulate_session(
        model, without_optional(oarlock.calibration.default_plan(model)), ANY_ROTATION
    )
    found = oarlock.calibration.calibrate_session(model, trial.recording)
    assert found.noted["session"]["passed"]


def test_errors_of_segments_do_not_add_up():
    model = oarlock.load_model("upper_body")
    std_rad = np.radians(3.0)
    still = replace(ANY_ROTATION, posture_rad=0.0, sway_rad=0.0)
    off = {"segment_rad": [], "posture_rad": []}
    for seed, (name, found) in product(range(12), off.items()):
        trial = oarlock.simulation.simulate_session(
            model,
            SessionPlan("one", (SessionStep("N", "pose"),)),
            replace(still, **{name: std_rad}),
            seed=seed,
        )
        head = list(model.frame_names).index("head")
        poses = model.forward_kinematics(np.asarray(trial.truth.q[[0, -1]]))[:, head, :3, :3]
        found.append(Rotation.from_matrix(poses[0].T @ poses[1]).as_rotvec())
    spread = {name: np.sqrt(np.mean(np.square(found))) for name, found in off.items()}
    assert 0.7 * std_rad < spread["segment_rad"] < 1.3 * std_rad < spread["posture_rad"]


@pytest.mark.long
@pytest.mark.parametrize("name", ["lower_body", "upper_body"])
def test_angles_after_a_pose_and_three_movements(name):
    model = oarlock.load_model(name)
    plan = replace(without_optional(oarlock.calibration.default_plan(model)), posture_std_rad=POSTURE_STD_RAD)
    rmses_deg, shares = [], []
    for seed in range(20):
        trial = oarlock.simulation.simulate_session(model, plan, IN_THE_FIELD, seed=seed)
        found = oarlock.calibration.calibrate_session(model, trial.recording, plan)
        assert found.noted["session"]["passed"]
        assert mean_mount_deg(trial, found) < MEAN_MOUNT_DEG
        track = oarlock.track(model, trial.recording, found)
        scores = [oarlock.evaluate(each, trial.truth) for each in (track, oarlock.smooth(track))]
        rmses_deg.append([score.mean_rmse_deg() for score in scores])
        shares.append([score.mean_coverage() for score in scores])
    assert (np.mean(rmses_deg, axis=0) < RMSE_DEG).all(), rmses_deg
    live, smoothed = np.mean(shares, axis=0)
    assert COVERAGE[0] < live < COVERAGE[1] and COVERAGE[0] < smoothed < COVERAGE[1], shares
