"""Two hinges whose axes are unknown become one ball: the model, its angle, and the command that asks for it."""

import numpy as np
import pytest

import oarlock
from refusals import assert_refused

HINGES = ("elbow_flexion_r", "elbow_pronation_r")
UNITS = ["thorax", "upper_arm_r", "forearm_r"]
EXACT_RAD = 1e-9


@pytest.fixture
def arm():
    return oarlock.load_model("arm", stature_m=1.78, mass_kg=75).with_units(UNITS)


def pose(model, frame, **angles_rad):
    q = np.concatenate([np.ravel(joint.rest) for joint in model.describe().joints])
    for name, value in angles_rad.items():
        q[model.coordinate_names.index(name)] = value
    return model.forward_kinematics(q)[model.frame_names.index(frame)]


def test_the_ball_rests_where_the_hinges_rest(arm):
    ball = oarlock.model.with_ball_joint(arm, *HINGES)
    np.testing.assert_allclose(pose(ball, "forearm_r"), pose(arm, "forearm_r"), atol=EXACT_RAD)
    joint = next(j for j in ball.describe().joints if j.name == "elbow_r")
    assert joint.kind == "ball" and joint.cone.swing[0] == pytest.approx(np.radians(150.0))
    assert joint.cone.twist == pytest.approx((-np.pi, np.pi))
    assert not set(HINGES) & set(ball.joint_names) and "forearm_flexed_r" not in ball.frame_names


def test_a_left_elbow_of_a_whole_body():
    body = oarlock.load_model("full_body")
    ball = oarlock.model.with_ball_joint(body, "elbow_flexion_l", "elbow_pronation_l")
    np.testing.assert_allclose(pose(ball, "hand_l"), pose(body, "hand_l"), atol=EXACT_RAD)
    assert "elbow_l" in ball.joint_names and set(HINGES) <= set(ball.joint_names)


@pytest.mark.parametrize(
    ("hinges", "words"),
    [
        (("shoulder_r", "elbow_flexion_r"), ("shoulder_r", "is no hinge")),
        (("elbow", "elbow_pronation_r"), ('"elbow"', "is no hinge")),
        (("elbow_pronation_r", "elbow_flexion_r"), ("does not follow", "same point")),
        (("elbow_pronation_r", "wrist_flexion_r"), ("does not follow", "same point")),
    ],
)
def test_what_is_no_such_pair_is_refused(hinges, words):
    assert_refused(lambda: oarlock.model.with_ball_joint(oarlock.load_model("arm"), *hinges), *words)


def test_flexion_is_the_angle_between_the_long_axes_whatever_the_mounts_heading(arm):
    """A forearm's unit that is turned about the forearm by any angle gives the same flexion."""
    ball = oarlock.model.with_ball_joint(arm, *HINGES)
    time_s = np.arange(0.0, 4.0, 0.02)
    bend_rad = 0.6 * (1.0 - np.cos(np.pi * time_s / 2.0))
    q = np.zeros((len(time_s), len(ball.coordinate_names)))
    for heading_rad in (0.0, 1.2):
        axis = np.array([np.sin(heading_rad), 0.0, np.cos(heading_rad)])
        columns = [ball.coordinate_names.index(f"elbow_r.r{letter}") for letter in "xyz"]
        q[:, columns] = bend_rad[:, None] * axis
        motion = oarlock.simulation.Motion(tuple(ball.coordinate_names), time_s, q)
        truth, _ = oarlock.simulate(ball, motion, seed=0, rate_hz=50)
        angles = oarlock.joint_angles(truth)
        assert [name for name in angles if name.startswith("elbow")] == ["elbow_flexion_r"]
        expected = np.interp(truth.time_s, time_s, bend_rad)
        np.testing.assert_allclose(angles["elbow_flexion_r"].angle_rad, expected, atol=1e-3)
