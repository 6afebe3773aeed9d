"""Still poses of guided sessions: N, T and sitting, in plans, in the search for steps and on the command line."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.simulation import SessionErrors
from refusals import assert_refused

ANY_ROTATION = SessionErrors(mount_rad=2.5)
MEAN_MOUNT_DEG = 4.0
"""The limit of sessions with the pose N."""
LEVEL_RAD = np.radians(3.0)


def session(body, pose, seed):
    """A session without its optional steps, and what is found in it."""
    plan = oarlock.calibration.default_plan(body, pose)
    short = replace(plan, steps=tuple(step for step in plan.steps if not step.optional))
    trial = oarlock.simulation.simulate_session(body, short, ANY_ROTATION, seed=seed)
    return trial, oarlock.calibration.calibrate_session(body, trial.recording, plan)


def mean_mount_deg(trial, found):
    turns = [found.mounts[u][0] @ trial.calibration.mounts[u][0].T for u in trial.calibration.mounts]
    return float(np.degrees(Rotation.from_matrix(np.array(turns)).magnitude()).mean())


def directions(body, pose):
    """Frame -> rotation matrix in the first still pose of a session."""
    plan = oarlock.calibration.default_plan(body, pose)
    rest = np.concatenate([np.ravel(joint.rest) for joint in body.describe().joints])
    pose = next(s.pose for s in plan.steps if s.kind == "pose")
    q = [pose.get(name, value) for name, value in zip(body.coordinate_names, rest, strict=True)]
    return dict(zip(body.frame_names, body.forward_kinematics(np.array(q)), strict=True))


def test_arms_are_level_and_palms_down_in_the_pose_t():
    poses = directions(oarlock.load_model("full_body"), "T")
    for side, outward in (("r", 1.0), ("l", -1.0)):
        shoulder, wrist = (poses[f"{name}_{side}"][:3, 3] for name in ("upper_arm", "hand"))
        along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        assert outward * along[2] > np.cos(LEVEL_RAD) and abs(along[1]) < np.sin(LEVEL_RAD)
        palm = poses[f"hand_{side}"][:3, 0]  # X of a hand points out of its palm
        assert palm[1] < -np.cos(np.radians(10.0))


def test_thighs_are_level_and_shanks_vertical_when_sitting():
    poses = directions(oarlock.load_model("lower_body"), "sitting")
    for side in "rl":
        np.testing.assert_allclose(poses[f"thigh_{side}"][:3, 1], [-1.0, 0.0, 0.0], atol=1e-4)
        np.testing.assert_allclose(poses[f"shank_{side}"][:3, 1], [0.0, 1.0, 0.0], atol=1e-4)


@pytest.mark.parametrize(("name", "pose"), [("arm", "T"), ("lower_body", "sitting")])
def test_mounts_from_another_pose(name, pose):
    body = oarlock.load_model(name)
    trial, found = session(body, pose, 0)
    assert mean_mount_deg(trial, found) < MEAN_MOUNT_DEG
    placed = {s["name"]: s for s in found.noted["session"]["step"] if "start_s" in s}
    for step, (start, end) in trial.spans.items():
        assert placed[step]["start_s"] < 0.5 * (start + end) < placed[step]["end_s"]


def test_a_rest_with_hanging_arms_is_not_taken_for_the_pose_t():
    body = oarlock.load_model("arm")
    plan = oarlock.calibration.default_plan(body, "T")
    hanging = replace(plan, steps=tuple(replace(s, pose={}) if s.kind == "pose" else s for s in plan.steps))
    trial = oarlock.simulation.simulate_session(body, hanging, ANY_ROTATION, seed=1)
    found = oarlock.calibration.calibrate_session(body, trial.recording, plan)
    outcomes = {s["name"]: s["outcome"] for s in found.noted["session"]["step"]}
    assert outcomes["T-pose"] == outcomes["T-pose again"] == "redo"


def test_each_pose_has_its_own_steps():
    legs = oarlock.load_model("lower_body")
    names = {
        p: [s.name for s in oarlock.calibration.default_plan(legs, p).steps] for p in ("N", "t", "SITTING")
    }
    assert names["N"][0] == "N-pose" and names["t"][0] == "T-pose"
    assert "right leg swing" in names["N"] and "right leg swing" not in names["SITTING"]
    assert {"right knee lift", "knee stretch"} < set(names["SITTING"])
    moves = [s for s in oarlock.calibration.default_plan(legs, "sitting").steps if s.kind == "move"]
    assert all(s.pose["knee_flexion_r"] > 1.5 for s in moves)
    assert all("shoulder_r.rx" not in s.pose for s in oarlock.calibration.default_plan(legs, "T").steps)


def test_a_pose_that_a_plan_lacks(tmp_path):
    legs, rower = oarlock.load_model("lower_body"), oarlock.load_model("sculler")
    assert_refused(
        lambda: oarlock.calibration.default_plan(legs, "sit"), "N, T, sitting", 'Did you mean "sitting"?'
    )
    assert_refused(lambda: oarlock.calibration.default_plan(rower, "T"), "it has N")
    assert_refused(
        lambda: oarlock.calibration.default_plan(oarlock.load_model("pendulum3"), "T"),
        "pendulum3",
        "it has N",
    )
    plan = tmp_path / "plan.toml"
    plan.write_text('format = 1\n[[posture]]\nname = "lying"\nposition = 3\n')
    assert_refused(lambda: oarlock.calibration.load_session_plan(plan, "lying"), "position")


def test_a_plan_file_with_a_pose_of_its_own(tmp_path):
    plan = tmp_path / "plan.toml"
    plan.write_text(
        'format = 1\n[[posture]]\nname = "lying"\npose = { "pelvis.rz" = 1.5708 }\nmovements = true\n'
        '[[step]]\nname = "lie"\nkind = "pose"\n'
        '[[step]]\nname = "bend"\nkind = "move"\njoints = ["knee_flexion_r"]\n'
        '[[step]]\nname = "stand"\nkind = "pose"\nposes = ["N"]\n'
    )
    lying = oarlock.calibration.load_session_plan(plan, "lying")
    assert [(s.name, dict(s.pose)) for s in lying.steps] == [
        ("lie", {"pelvis.rz": 1.5708}),
        ("bend", {"pelvis.rz": 1.5708}),
    ]
    assert [s.name for s in oarlock.calibration.load_session_plan(plan).steps] == ["lie", "bend", "stand"]


def test_on_the_command_line(tmp_path):
    common = ("--model", "arm", "--pose", "T")
    said = run("simulate", "--calibration-session", *common, "--seed", 2, "--out", tmp_path / "rec").output
    assert "--pose T" in said
    said = run("calibrate", "session", *common, "--write-plan", tmp_path / "plan.toml").output
    assert "T-pose again" in said
    run("calibrate", "session", tmp_path / "rec", *common, "--out", tmp_path / "cal.toml")
    steps = oarlock.load_calibration(tmp_path / "cal.toml").noted["session"]["step"]
    assert {s["name"] for s in steps if "start_s" in s} >= {"T-pose", "T-pose again", "arm swing"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "pose"), [("lower_body", "sitting"), ("upper_body", "T"), ("upper_body", "sitting")]
)
def test_mounts_from_other_poses_over_seeds(name, pose):
    body = oarlock.load_model(name)
    for seed in range(10):
        trial, found = session(body, pose, seed)
        assert mean_mount_deg(trial, found) < MEAN_MOUNT_DEG
