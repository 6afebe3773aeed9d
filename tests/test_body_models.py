"""Shipped bodies with ball joints: the sculler on ball shoulders is the sculler, and is tracked as well."""

import numpy as np
import pytest

import oarlock
from exact_recording import ELEVEN, SETTLED_S, STRUCTURES, load_excerpt, sculler
from oarlock.model.rotation import quat_from_matrix, rotvec_between, rotvec_from_quat

SHOULDER = ("abduction", "rotation", "flexion")
FRAMES = ("r_elbow", "r_wrist", "r_hand", "l_elbow", "l_wrist", "l_hand", "r_handle", "l_handle")

# The same products of rotations in another order of brackets.
EQUAL = 1e-9

# RMSE. On this excerpt both models have 0.02 to 0.03 deg in trunk and elbows. The shoulder's error is the angle of its
# rotation, which adds up three axes: 0.02 to 0.035 deg. Strapdown links, whose units sit on skin, have 0.25 to 0.38 and
# 0.33 to 0.41 deg, with hinges as with balls. Half as much again for other arithmetic.
MEAN_DEG = {"tree": 0.045, "strapdown": 0.57}
SHOULDER_DEG = {"tree": 0.05, "strapdown": 0.6}


@pytest.fixture(scope="module")
def ball() -> oarlock.Model:
    return oarlock.load_model("sculler_ball")


def on_balls(ball, q, qd, qdd):
    """Values (T, n) of the sculler's joints as those of the ball shoulders; rates in child axes."""
    hinges = list(sculler().joint_names)
    frames = list(sculler().frame_names)
    found = [np.zeros((len(q), len(ball.coordinate_names))) for _ in range(3)]
    for k, name in enumerate(ball.coordinate_names):
        if name in hinges:
            for into, values in zip(found, (q, qd, qdd), strict=True):
                into[:, k] = values[:, hinges.index(name)]
    at_zero = sculler().forward_kinematics(np.zeros(len(hinges)))[:, :3, :3]
    for side in "rl":
        columns = [hinges.index(f"{side}_shoulder_{joint}") for joint in SHOULDER]
        into = [ball.coordinate_names.index(f"{side}_shoulder.{c}") for c in ("rx", "ry", "rz")]
        elbow, shoulder = (frames.index(f"{side}_{name}") for name in ("elbow", "shoulder"))
        upper_arm = at_zero[elbow].T @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
        parent = at_zero[shoulder].T @ at_zero[elbow] @ upper_arm

        def turned(
            time_s, elbow=elbow, shoulder=shoulder, upper_arm=upper_arm, parent=parent, columns=columns
        ):
            moved = np.zeros_like(q)
            rates = (x[:, columns] for x in (q, qd, qdd))
            moved[:, columns] = sum(x * f for x, f in zip(rates, (1.0, time_s, time_s**2 / 2), strict=True))
            poses = sculler().forward_kinematics(moved)[..., :3, :3]
            return parent.T @ np.swapaxes(poses[:, shoulder], 1, 2) @ poses[:, elbow] @ upper_arm

        found[0][:, into] = rotvec_from_quat(quat_from_matrix(turned(0.0)))
        found[1][:, into], found[2][:, into] = rates_of(turned)
    return found


def rates_of(turned, step_s=2e-3):
    """Angular velocity and acceleration (T, 3) in child axes, by differences of the sixth order."""
    here = turned(0.0)
    odd, even = (45 / 60, -9 / 60, 1 / 60), (270 / 180, -27 / 180, 2 / 180)
    first = second = 0.0
    for k, (a, b) in enumerate(zip(odd, even, strict=True), 1):
        after, before = turned(k * step_s), turned(-k * step_s)
        first = first + a * (after - before) / step_s
        second = second + b * (after + before - 2 * here) / step_s**2
    back = np.swapaxes(here, 1, 2)
    # R' dR is the rate's cross product; of R' ddR the part that is not symmetric is that of its derivative.
    return [
        np.column_stack([x[:, i, j] - x[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))]) / 2
        for x in (back @ first, back @ second)
    ]


def postures(count=40):
    random, shape = np.random.default_rng(0), (count, len(sculler().joint_names))
    return random.uniform(-0.6, 0.6, shape), random.normal(size=shape), random.normal(size=shape)


def test_ball_shoulders_are_at_rest_where_the_hinges_are(ball):
    rest = np.concatenate([np.ravel(j.rest) for j in ball.describe().joints])
    hinges = np.array([[j.rest for j in sculler().describe().joints]])
    assert rest == pytest.approx(on_balls(ball, hinges, 0 * hinges, 0 * hinges)[0][0], abs=EQUAL)


def test_ball_shoulders_have_the_hinges_poses(ball):
    q, qd, qdd = postures()
    theirs, ours = sculler().forward_kinematics(q), ball.forward_kinematics(on_balls(ball, q, qd, qdd)[0])
    for frame in FRAMES:
        found, expected = (
            ours[:, ball.frame_names.index(frame)],
            theirs[:, sculler().frame_names.index(frame)],
        )
        np.testing.assert_allclose(found, expected, rtol=0, atol=EQUAL, err_msg=frame)


def test_ball_shoulders_have_the_hinges_readings(ball):
    posture = postures()
    theirs, ours = (
        sculler().predict_measurements(*posture),
        ball.predict_measurements(*on_balls(ball, *posture)),
    )
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=EQUAL)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_ball_shoulders_are_tracked_as_well_as_hinges(ball, structure):
    exact = load_excerpt()
    track = oarlock.track(ball, exact.recording, config=oarlock.Config(structure=structure))
    settled = track.time_s >= SETTLED_S
    rows = np.searchsorted(exact.truth.time_s, track.time_s - 1e-6)
    for name in ELEVEN:
        if "shoulder" not in name:
            theirs = exact.truth.q[rows, exact.truth.joint_names.index(name)]
            error = np.degrees(track.q[:, track.coordinate_names.index(name)] - theirs)[settled]
            assert np.sqrt(np.mean(error**2)) <= MEAN_DEG[structure], name
    for side in "rl":
        pair = f"{side}_elbow", f"{side}_shoulder"
        turn = rotvec_between(track.frame_quat_wxyz(*pair), exact.truth.frame_quat_wxyz(*pair)[rows])
        error = np.degrees(np.linalg.norm(turn, axis=1))[settled]
        assert np.sqrt(np.mean(error**2)) <= SHOULDER_DEG[structure], side
