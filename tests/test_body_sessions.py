"""Sessions for persons: units that move as one, steps in any order, optional steps, parts of a body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import SessionErrors, SessionPlan, SessionStep
from refusals import assert_refused

ANY_ROTATION = SessionErrors(mount_rad=2.5)
MEAN_MOUNT_DEG, RMSE_DEG = 4.0, 4.0


def without_optional(plan):
    return replace(plan, steps=tuple(step for step in plan.steps if not step.optional))


def session(name, seed):
    model = oarlock.load_model(name)
    plan = without_optional(oarlock.default_plan(model))
    trial = oarlock.simulate_session(model, plan, ANY_ROTATION, seed=seed)
    return model, trial, oarlock.calibrate_session(model, trial.recording)


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
    plan = without_optional(oarlock.default_plan(model))
    first, *moves, last = plan.steps
    mixed = replace(plan, steps=(first, *reversed(moves), last))
    trial = oarlock.simulate_session(model, mixed, ANY_ROTATION, seed=1)
    found = oarlock.calibrate_session(model, trial.recording)
    placed = {s["name"]: s for s in found.noted["session"]["step"] if "start_s" in s}
    for step in moves:
        start, end = trial.spans[step.name]
        assert placed[step.name]["start_s"] < 0.5 * (start + end) < placed[step.name]["end_s"]


def test_a_part_has_no_units_and_joints_that_it_lacks():
    plan = oarlock.default_plan(oarlock.load_model("lower_body"))
    assert {unit for step in plan.steps for unit in step.units} == {"shank_r", "foot_r", "shank_l", "foot_l"}
    assert "arm swing" not in [step.name for step in plan.steps]
    assert plan.any_order


def test_a_plan_with_the_new_keys_is_a_file(tmp_path):
    step = SessionStep("swing", "move", joints=("hip_flexion_r",), units=("shank_r",), optional=True)
    plan = SessionPlan("mine", (step,), any_order=True)
    plan.save(tmp_path / "plan.toml")
    assert oarlock.load_session_plan(tmp_path / "plan.toml") == plan


def test_values_of_wrong_types():
    move = {"name": "swing", "kind": "move", "joints": ("hip",)}
    assert_refused(lambda: SessionStep(**move, optional="yes"), "optional", "expected true or false")
    assert_refused(lambda: SessionStep(**move, units=3), "units")
    step = SessionStep(**move)
    assert_refused(lambda: SessionPlan("mine", (step,), any_order=1), "any_order", "expected true or false")


@pytest.mark.long
@pytest.mark.parametrize("name", ["lower_body", "upper_body"])
def test_angles_after_a_pose_and_three_movements(name):
    for seed in range(20):
        model, trial, found = session(name, seed)
        assert mean_mount_deg(trial, found) < MEAN_MOUNT_DEG
        scores = oarlock.evaluate(oarlock.smooth(oarlock.track(model, trial.recording, found)), trial.truth)
        assert scores.mean_rmse_deg() < RMSE_DEG and scores.mean_coverage() > 0.85
