"""Rotations and their named angles against scipy, identities and what each promises at its poles."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oarlock.model.angle_sequence import (
    NEAR_SINGULAR_RAD,
    SEQUENCES,
    angle_labels,
    angle_stds,
    angles_from_quat,
    angles_near,
    angles_per_turn,
    checked_sequence,
    near_singular,
    quat_from_angles,
)
from oarlock.model.rotation import (
    body_rates,
    continuous_quat,
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_inverse,
    quat_product,
    right_jacobian,
    rotvec_between,
    rotvec_from_quat,
    unit_quats,
    wrap,
)
from oarlock.storage.errors import DataError

ROUNDING = 1e-12
AT_A_POLE = 1e-7
"""An angle within rounding of a pole, where a sine's square is what is left: the root of 1e-16, and a little."""
CENTRAL_DIFFERENCE = 1e-6
"""A step of 1e-5 leaves its square times a third derivative near 1, and rounding over the step."""


def random_quats(count: int, seed: int = 0) -> np.ndarray:
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_quat()[:, [3, 0, 1, 2]]


def as_scipy(quat_wxyz: np.ndarray) -> Rotation:
    return Rotation.from_quat(quat_wxyz[:, [1, 2, 3, 0]])


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest angle between two lists of rotations, rad."""
    return float(np.linalg.norm(rotvec_between(a, b), axis=-1).max())


@pytest.mark.parametrize("length", [0.0, 1e-200, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 3.0, np.pi - 1e-9])
def test_log_undoes_exp(length):
    axes = np.random.default_rng(1).standard_normal((50, 3))
    r = length * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    np.testing.assert_allclose(rotvec_from_quat(quat_from_rotvec(r)), r, rtol=1e-12, atol=0)


def test_whole_turns_are_dropped():
    r = np.array([[0.0, 0.0, 0.3 + 2 * np.pi], [2 * np.pi, 0.0, 0.0], [0.0, -1.5 * np.pi, 0.0]])
    shortest = rotvec_from_quat(quat_from_rotvec(r))
    np.testing.assert_allclose(shortest, [[0, 0, 0.3], [0, 0, 0], [0, 0.5 * np.pi, 0]], atol=ROUNDING)


def test_products_matrices_and_logs_are_those_of_scipy():
    p, q = random_quats(200, 1), random_quats(200, 2)
    both = as_scipy(p) * as_scipy(q)
    assert apart(quat_product(p, q), both.as_quat()[:, [3, 0, 1, 2]]) < ROUNDING
    np.testing.assert_allclose(matrix_from_quat(p), as_scipy(p).as_matrix(), atol=ROUNDING)
    np.testing.assert_allclose(rotvec_from_quat(p), as_scipy(p).as_rotvec(), atol=ROUNDING)
    assert apart(quat_from_matrix(matrix_from_quat(p)), p) < ROUNDING
    e = rotvec_between(p, q)
    assert apart(quat_product(p, quat_from_rotvec(e)), q) < ROUNDING


def test_a_missing_rotation_stays_missing_and_harms_no_other():
    q = random_quats(6)
    q[2] = np.nan
    lost = np.array([False, False, True, False, False, False])
    for found in (
        rotvec_from_quat(q),
        quat_product(q, q),
        continuous_quat(q),
        angles_from_quat(q, "YXY"),
        matrix_from_quat(q).reshape(6, 9),
        quat_from_matrix(matrix_from_quat(q)),
    ):
        assert np.array_equal(np.isnan(found).all(axis=1), lost)
        assert np.array_equal(np.isnan(found).any(axis=1), lost)
    assert not near_singular(q, "YXY")[2]


def test_continuous_quaternions_do_not_jump_and_are_the_same_rotations():
    angle = np.linspace(0.0, 30.0, 500)
    q = quat_from_rotvec(np.outer(angle, [0.0, 0.6, 0.8]))
    rough = q * np.where(np.random.default_rng(0).random(500) < 0.5, -1.0, 1.0)[:, None]
    smooth = continuous_quat(rough)
    assert np.abs(np.diff(smooth, axis=0)).max() < 0.04
    assert apart(smooth, q) < ROUNDING


def test_body_rates_are_those_of_the_rotation_vector():
    """w = Jr(r) r' by Solà's closed form of Jr (eq. 143), and its derivative by central differences."""

    def r(t):
        return np.stack([0.8 * np.sin(t), 1.1 * np.cos(0.7 * t), 0.5 * t], axis=-1)

    def velocity(t):
        x, step = r(t), 1e-5
        dx = (r(t + step) - r(t - step)) / (2 * step)
        angle = np.linalg.norm(x, axis=-1)[:, None]
        once, twice = np.cross(x, dx), np.cross(x, np.cross(x, dx))
        return dx - (1 - np.cos(angle)) / angle**2 * once + (angle - np.sin(angle)) / angle**3 * twice

    t, step = np.linspace(0.1, 3.0, 40), 1e-3
    at = [3.0 * quat_from_rotvec(r(t + k * step)) for k in (-2, -1, 0, 1, 2)]
    first = (at[0] - 8 * at[1] + 8 * at[3] - at[4]) / (12 * step)
    second = (-at[0] + 16 * at[1] - 30 * at[2] + 16 * at[3] - at[4]) / (12 * step**2)
    w, dw = body_rates(at[2], first, second)
    np.testing.assert_allclose(w, velocity(t), atol=CENTRAL_DIFFERENCE)
    expected = (velocity(t + step) - velocity(t - step)) / (2 * step)
    np.testing.assert_allclose(dw, expected, atol=CENTRAL_DIFFERENCE)


def test_quaternions_of_another_norm_are_refused():
    q = random_quats(3)
    q[1] = np.nan
    assert np.isnan(unit_quats(1.001 * q, "here")[1]).all()
    with pytest.raises(DataError, match=r"here\[2\] has norm 1\.2.*w first"):
        unit_quats(np.array([[1.0], [1.0], [1.2]]) * q, "here")


def test_there_are_twelve_sequences_and_others_are_refused():
    assert len(SEQUENCES) == 12
    assert {"YXY", "XZY", "ZXY"} <= set(SEQUENCES)
    for wrong in ("XXY", "xyz", "XY", "XYZX", "ABC", ""):
        with pytest.raises(DataError, match=r"YXY.*ZXY") as caught:
            checked_sequence(wrong, "joint")
        assert repr(wrong) in str(caught.value)
    assert angle_labels("YXY") == ("y1", "x", "y2")
    assert angle_labels("ZXY") == ("z", "x", "y")


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_are_those_of_scipy(sequence):
    q = random_quats(300, 3)
    clear = ~near_singular(q, sequence)
    expected = as_scipy(q).as_euler(sequence)
    single = np.vstack([angles_from_quat(row[None], sequence) for row in q])
    np.testing.assert_allclose(
        wrap(single - expected)[clear], 0.0, atol=1e-11
    )  # rounding over a sine of 15 deg
    assert apart(quat_from_angles(single, sequence), q) < 1e-11
    assert np.abs(single).max() <= np.pi + ROUNDING


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_mean_the_rotation_everywhere_also_at_the_poles(sequence):
    ends = (0.0, np.pi) if sequence[0] == sequence[2] else (-np.pi / 2, np.pi / 2)
    angles = np.array(
        [[a, b + d, c] for a in (0.3, -2.0) for b in ends for c in (0.0, 1.0) for d in (0, 1e-9, -1e-4)]
    )
    q = quat_from_angles(angles, sequence)
    assert near_singular(q, sequence).all()
    assert apart(quat_from_angles(angles_from_quat(q, sequence), sequence), q) < AT_A_POLE
    assert apart(quat_from_angles(angles_near(q, sequence, angles), sequence), q) < AT_A_POLE


@pytest.mark.parametrize("sequence", ["YXY", "ZXY", "XZY"])
def test_a_swing_through_a_pole_has_no_jump(sequence):
    pole, way = (0.0, -1.2) if sequence == "YXY" else (np.pi / 2, 1.2)  # from the usual range beyond it
    t = np.linspace(-1.0, 1.0, 401)
    course = np.stack([0.4 + 0.1 * t, pole + way * t + 1e-3, -0.3 + 0.2 * t], axis=1)
    found = angles_from_quat(quat_from_angles(course, sequence), sequence)
    assert np.abs(np.diff(found, axis=0)).max() < 0.02
    np.testing.assert_allclose(found, course, atol=1e-9)


def test_many_turns_about_each_axis_are_counted():
    t = np.linspace(0.0, 1.0, 2001)
    for k in range(3):
        course = np.tile([0.2, 0.3, 0.1], (len(t), 1))
        course[:, k] += 25.0 * t
        found = angles_from_quat(quat_from_angles(course, "ZXY"), "ZXY")
        np.testing.assert_allclose(found - found[0], course - course[0], atol=1e-9)


def test_angles_go_on_after_a_stay_near_a_pole():
    """An arm hangs, its plane of elevation drifts by 2 rad while it is within 15 deg of the pole, and lifts again."""
    elevation = np.concatenate([np.linspace(0.8, 0.05, 100), np.full(100, 0.05), np.linspace(0.05, 0.8, 100)])
    plane = np.concatenate([np.zeros(100), np.linspace(0.0, 1.2, 100), np.full(100, 1.2)])
    course = np.stack([plane, elevation, -plane], axis=1)
    noise = quat_from_rotvec(0.03 * np.random.default_rng(4).standard_normal((300, 3)))
    q = quat_product(quat_from_angles(course, "YXY"), noise)
    found = angles_from_quat(q, "YXY")
    clear = ~near_singular(q, "YXY")
    assert clear[:50].all() and clear[-50:].all() and not clear[120:180].any()
    # noise of 0.03 rad over the sine of 15 deg, five of them
    assert np.abs(found[clear] - course[clear]).max() < 5 * 0.03 / np.sin(NEAR_SINGULAR_RAD)


def test_the_usual_range_comes_first():
    q = quat_from_angles(np.array([[3.0, 0.5, -3.0]]), "YXY")
    np.testing.assert_allclose(angles_from_quat(q, "YXY"), [[3.0, 0.5, -3.0]], atol=ROUNDING)
    q = quat_from_angles(np.array([[3.0, -0.5, -3.0]]), "ZXY")
    np.testing.assert_allclose(angles_from_quat(q, "ZXY"), [[3.0, -0.5, -3.0]], atol=ROUNDING)


def test_angles_near_others_take_their_side_and_their_turns():
    wanted = np.array([[0.3 + 4 * np.pi, -0.7, 0.2 - 2 * np.pi]])
    q = quat_from_angles(wanted + 0.01, "YXY")
    np.testing.assert_allclose(angles_near(q, "YXY", wanted), wanted + 0.01, atol=1e-11)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_growth_of_the_angles_is_their_derivative(sequence):
    q = random_quats(100, 5)
    q = q[~near_singular(q, sequence)]
    angles, step = angles_from_quat(q, sequence), 1e-5
    growth = angles_per_turn(angles, sequence)
    for k in range(3):
        turned = [quat_product(q, quat_from_rotvec(sign * step * np.eye(3)[k])) for sign in (1, -1)]
        after, before = (angles_near(t, sequence, angles) for t in turned)
        np.testing.assert_allclose((after - before) / (2 * step), growth[:, :, k], atol=1e-5)
        # third derivatives grow with the fourth power of 1 / sin 15 deg


def test_deviations_of_angles_are_those_of_samples():
    angle, std = np.array([[0.4, 0.9, -1.0]]), np.array([[0.01, 0.02, 0.005]])
    claimed = angle_stds(angle, "YXY", std)[0]
    n = 40_000
    errors = std * np.random.default_rng(6).standard_normal((n, 3))
    drawn = quat_product(quat_from_angles(angle, "YXY"), quat_from_rotvec(errors))
    found = angles_near(drawn, "YXY", np.tile(angle, (n, 1))).std(axis=0)
    # five standard errors of a deviation, and the square of the spread for what first order leaves out
    np.testing.assert_allclose(found / claimed, 1.0, atol=5 / np.sqrt(2 * n) + 0.02**2 * 10)


def test_at_a_pole_the_deviation_is_not_a_number_to_trust():
    stds = angle_stds(np.array([[0.0, 0.0, 0.0]]), "YXY", np.full((1, 3), 0.01))
    assert not np.isfinite(stds[0, [0, 2]]).any()


def test_inverse_of_a_quaternion():
    q = random_quats(5)
    assert apart(quat_product(q, quat_inverse(q)), np.tile([1.0, 0, 0, 0], (5, 1))) < ROUNDING


@pytest.mark.parametrize("angle_rad", [0.0, 1e-4, 0.009, 0.011, 1.4, 3.0])
def test_the_right_jacobian_is_the_derivative_of_the_exponential(angle_rad):
    rotvec = angle_rad * np.array([0.6, -0.48, 0.64])
    step = 1e-5 * np.eye(3)
    here = Rotation.from_rotvec(rotvec).inv()
    turns = [(here * Rotation.from_rotvec(rotvec + s)).as_rotvec() for s in (*step, *-step)]
    difference = (np.array(turns[:3]) - np.array(turns[3:])).T / 2e-5
    # a central difference of this step is good to 1e-10
    assert np.abs(right_jacobian(rotvec) - difference).max() < 1e-9
