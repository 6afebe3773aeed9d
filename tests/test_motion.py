"""Motions of ball and free joints: through every knot, smooth everywhere, and their rates in the child's axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oarlock import DataError
from oarlock.model.coordinates import joint_columns, parts
from oarlock.model.rotation import quat_from_rotvec, quat_product, rotvec_between
from oarlock.simulation import Motion

ROUNDING = 1e-9
KNOT_S = 0.05
SPLINE = 2e-6
"""A quintic spline misses a sine of w rad/s by about (w h)^6 / 1000: here w h = 0.15, ends are worse."""

TIME_S = np.arange(0.0, 4.0 + 1e-9, KNOT_S)


def apart(a, b) -> float:
    return float(np.linalg.norm(rotvec_between(a, b), axis=-1).max())


def wave(time_s):
    """Rotation vectors, (..., 3), that go far beyond half a turn."""
    return np.stack([2.5 * np.sin(1.1 * time_s), 2.0 * np.cos(0.9 * time_s), 1.5 * time_s], axis=-1)


def inner(count: int = 301) -> np.ndarray:
    return np.linspace(0.3, 3.7, count)


def test_knots_are_met_and_the_way_between_is_the_rotation():
    motion = Motion.from_joints(TIME_S, {"hip": wave(TIME_S)})
    assert motion.coordinate_names == ("hip.rx", "hip.ry", "hip.rz")
    assert motion.joint_names == ("hip",)
    assert apart(quat_from_rotvec(motion.at(TIME_S)), quat_from_rotvec(wave(TIME_S))) < ROUNDING
    assert apart(quat_from_rotvec(motion.at(inner())), quat_from_rotvec(wave(inner()))) < 1e-4
    assert np.linalg.norm(motion.at(inner()), axis=1).max() <= np.pi + ROUNDING


def test_many_whole_turns_keep_their_speed():
    axis = np.array([0.6, 0.0, 0.8])
    motion = Motion.from_joints(TIME_S, {"wheel": np.outer(6.0 * TIME_S, axis)})
    q, qd, qdd = motion.derivatives(inner())
    assert apart(quat_from_rotvec(q), quat_from_rotvec(np.outer(6.0 * inner(), axis))) < SPLINE
    np.testing.assert_allclose(qd, np.broadcast_to(6.0 * axis, qd.shape), atol=1e-4)
    np.testing.assert_allclose(qdd, 0.0, atol=1e-2)


def test_a_wobble_about_a_whole_turn_is_as_smooth_as_any():
    """There the rotation vector itself is singular: a small wobble turns it round."""
    wobble = np.stack([0.05 * np.sin(3 * TIME_S), 0.05 * np.cos(3 * TIME_S), np.zeros_like(TIME_S)], axis=1)
    turned = quat_product(quat_from_rotvec([[0.0, 0.0, 2 * np.pi - 1e-9]]), quat_from_rotvec(wobble))
    motion = Motion.from_joints(TIME_S, {"hip": turned})
    _, qd, qdd = motion.derivatives(inner())
    assert np.linalg.norm(qd, axis=1).max() < 0.16
    assert np.linalg.norm(qdd, axis=1).max() < 0.5


def test_rates_are_those_of_the_matrices_in_the_childs_axes():
    motion = Motion.from_joints(TIME_S, {"hip": wave(TIME_S)})
    t, step = inner(), 1e-3

    def matrix(time_s):
        return Rotation.from_rotvec(motion.at(time_s)).as_matrix()

    def spin(time_s):
        slope = (
            matrix(time_s - 2 * step)
            - 8 * matrix(time_s - step)
            + 8 * matrix(time_s + step)
            - matrix(time_s + 2 * step)
        ) / (12 * step)
        cross = matrix(time_s).transpose(0, 2, 1) @ slope
        return np.stack([cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0]], axis=1)

    _, qd, qdd = motion.derivatives(t)
    # of fourth order: the fifth derivative, near 100 rad/s5, times step^4 / 30
    np.testing.assert_allclose(qd, spin(t), atol=1e-9)
    np.testing.assert_allclose(qdd, (spin(t + step) - spin(t - step)) / (2 * step), atol=1e-4)


def test_the_fourth_derivative_does_not_jump_at_knots():
    """Fourth differences over 2 ms, either side of each knot, differ no more than the fifth derivative makes them."""
    motion = Motion.from_joints(TIME_S, {"hip": wave(TIME_S)})
    step = 2e-3
    knots = TIME_S[10:-10]

    def fourth(time_s):
        offsets = (np.arange(5) - 2) * step
        quats = quat_from_rotvec(motion.at(time_s[:, None] + offsets))
        quats *= np.sign(np.sum(quats * quats[:, 2:3], axis=-1, keepdims=True))
        return np.einsum("k,tki->ti", [1.0, -4.0, 6.0, -4.0, 1.0], quats) / step**4

    jump = np.abs(fourth(knots + 2 * step) - fourth(knots - 2 * step)).max()
    slope = np.abs(fourth(knots + KNOT_S / 2 + step) - fourth(knots + KNOT_S / 2 - step)).max() / (2 * step)
    assert jump < 2 * 4 * step * slope


def test_a_free_joint_is_a_position_and_a_rotation():
    place = np.stack([np.sin(TIME_S), TIME_S, np.cos(TIME_S)], axis=1)
    by_quat = Motion.from_joints(
        TIME_S, {"pelvis": np.hstack([place, quat_from_rotvec(wave(TIME_S))]), "trunk": np.sin(2 * TIME_S)}
    )
    by_vector = Motion.from_joints(
        TIME_S, {"pelvis": np.hstack([place, wave(TIME_S)]), "trunk": np.sin(2 * TIME_S)}
    )
    assert by_quat.joint_names == ("pelvis", "trunk")
    assert by_quat.coordinate_names[:4] == ("pelvis.x", "pelvis.y", "pelvis.z", "pelvis.rx")
    for a, b in zip(by_quat.derivatives(inner()), by_vector.derivatives(inner()), strict=True):
        np.testing.assert_allclose(a, b, atol=ROUNDING)
    q, qd, _ = by_quat.derivatives(inner())
    np.testing.assert_allclose(q[:, 1], inner(), atol=ROUNDING)
    np.testing.assert_allclose(qd[:, 0], np.cos(inner()), atol=SPLINE)


def test_columns_may_stand_in_any_order():
    wanted = Motion.from_joints(TIME_S, {"hip": wave(TIME_S), "knee": np.cos(TIME_S)})
    names, q = ("hip.rz", "knee", "hip.rx", "hip.ry"), np.column_stack([wanted.q[:, k] for k in (2, 3, 0, 1)])
    turned = Motion(names, TIME_S, q)
    order = [names.index(name) for name in wanted.coordinate_names]
    for a, b in zip(wanted.derivatives(inner()), turned.derivatives(inner()), strict=True):
        assert np.array_equal(a, b[..., order])
    assert np.array_equal(turned.column("hip.rx"), wanted.q[:, 0])


def test_shapes_of_times_are_kept():
    motion = Motion.from_joints(TIME_S, {"hip": wave(TIME_S), "knee": np.cos(TIME_S)})
    around = inner(7)[:, None] + np.linspace(-0.01, 0.01, 9)
    assert motion.at(around).shape == (7, 9, 4)
    assert all(x.shape == (7, 9, 4) for x in motion.derivatives(around))
    assert motion.at(1.0).shape == (4,)


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        ({"hip": np.outer(TIME_S, [40.0, 0, 0])}, r'"hip" rotates by 115 deg.*more knots'),
        ({"hip": np.zeros((len(TIME_S), 5))}, r"shape \(81, 5\)"),
        ({"hip": np.full((len(TIME_S), 4), 0.7)}, "norm 1.4"),
        ({"hip": np.zeros((7, 3)), "knee": TIME_S}, r"different numbers of knots \(hip: 7, knee: 81\)"),
        ({"hip": np.full((len(TIME_S), 3), np.nan)}, "is nan"),
        ({}, "no joint is given"),
    ],
    ids=["wide turns", "shape", "norm", "lengths", "nan", "nothing"],
)
def test_what_is_no_motion_is_explained(joints, said):
    with pytest.raises(DataError, match=said):
        Motion.from_joints(TIME_S, joints)


def test_a_ball_joint_needs_all_its_coordinates():
    with pytest.raises(DataError, match=r'"hip": there are hip\.rx, hip\.ry; .*hip\.x, \.y and \.z'):
        Motion(("hip.rx", "hip.ry"), TIME_S, np.zeros((len(TIME_S), 2)))
    with pytest.raises(DataError, match=r"hip\.rx"):
        Motion(("hip", "hip.rx"), TIME_S, np.zeros((len(TIME_S), 2)))


def test_coordinates_belong_to_joints():
    pelvis = [f"pelvis.{label}" for label in ("x", "y", "z", "rx", "ry", "rz")]
    names = ("trunk", *pelvis, "a.rz", "a.rx", "a.ry")
    assert joint_columns(names) == {"trunk": (0,), "pelvis": (1, 2, 3, 4, 5, 6), "a": (8, 9, 7)}
    assert [(p.name, p.kind) for p in parts(names)] == [
        ("trunk", "scalar"),
        ("pelvis.position", "position"),
        ("pelvis.rotation", "rotation"),
        ("a", "rotation"),
    ]
    assert parts(("x", "rx")) == parts(("x", "rx"))
    assert [p.kind for p in parts(("x", "rx"))] == ["scalar", "scalar"]
