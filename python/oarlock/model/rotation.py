"""Rotations as arrays: rotation vectors (..., 3) in rad and unit quaternions `quat_wxyz` (..., 4).

Both say parent-from-child. Shapes broadcast like numpy's, and a NaN stays a NaN.

Source of the formulas: J. Solà, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in robotics", 2018.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

NORM_TOLERANCE = 0.01
"""A quaternion whose norm is further from 1 is none: text formats with three digits stay well inside."""


def wrap(angle_rad: Floats) -> Floats:
    """The same angle in (-pi, pi], rad."""
    wrapped: Floats = np.pi - np.mod(np.pi - angle_rad, 2 * np.pi)
    return wrapped


def angle_between(one: Floats, two: Floats) -> float:
    """The angle of two vectors (3,) of any length, rad; as exact for small angles as for large ones."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, two)), np.dot(one, two)))


def quat_from_rotvec(rotvec_rad: ArrayLike) -> Floats:
    """Exp: the unit quaternion (..., 4) of a rotation vector (..., 3), rad; any number of turns is fine."""
    r = np.asarray(rotvec_rad, dtype=np.float64)
    half = 0.5 * np.linalg.norm(r, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * r], axis=-1)


def rotvec_from_quat(quat_wxyz: ArrayLike) -> Floats:
    """Log: the shortest rotation vector (..., 3), at most pi long, rad."""
    q = np.asarray(quat_wxyz, dtype=np.float64)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    tiny = sine < 1e-150
    angle_per_sine = 2.0 * np.arctan2(sine, q[..., :1]) / np.where(tiny, 1.0, sine)
    shortest: Floats = np.where(tiny, 2.0, angle_per_sine) * q[..., 1:]
    return shortest


def quat_product(a_from_b: ArrayLike, b_from_c: ArrayLike) -> Floats:
    """Hamilton's product: a_from_c, (..., 4)."""
    p, q = np.asarray(a_from_b, dtype=np.float64), np.asarray(b_from_c, dtype=np.float64)
    # by component: `np.cross` takes longer than all the rest for the few rows that most callers have
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    w = pw * qw - (px * qx + py * qy + pz * qz)
    x = pw * qx + qw * px + (py * qz - pz * qy)
    y = pw * qy + qw * py + (pz * qx - px * qz)
    z = pw * qz + qw * pz + (px * qy - py * qx)
    return np.stack([w, x, y, z], axis=-1)


def quat_inverse(quat_wxyz: ArrayLike) -> Floats:
    """The conjugate: child-from-parent, (..., 4)."""
    inverse: Floats = np.asarray(quat_wxyz, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def rotvec_between(start_wxyz: ArrayLike, end_wxyz: ArrayLike) -> Floats:
    """The turn e in the child's axes that leads from one rotation to another: end = start Exp(e), (..., 3) rad."""
    return rotvec_from_quat(quat_product(quat_inverse(start_wxyz), end_wxyz))


def right_jacobian(rotvec_rad: ArrayLike) -> Floats:
    """(3, 3) turn about the child's axes by a change of a rotation vector (3,): Exp(r + dr) = Exp(r) Exp(J dr)."""
    r = np.asarray(rotvec_rad, dtype=np.float64)
    angle, cross = float(np.linalg.norm(r)), np.cross(np.eye(3), r)
    half = np.sinc(0.5 * angle / np.pi)
    # (angle - sin(angle)) / angle^3 cancels near zero
    third = (1.0 - np.sinc(angle / np.pi)) / angle**2 if angle > 1e-2 else (1.0 - angle**2 / 20.0) / 6.0
    return np.asarray(np.eye(3) - 0.5 * half**2 * cross + third * cross @ cross)


def quat_from_matrix(matrix: ArrayLike) -> Floats:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3).

    Source: S. W. Shepperd 1978, "Quaternion from rotation matrix", J. Guidance and Control 1(3).
    """
    m = np.asarray(matrix, dtype=np.float64)
    diagonal = m[..., [0, 1, 2], [0, 1, 2]]
    trace = diagonal.sum(axis=-1)
    odd = m[..., [2, 0, 1], [1, 2, 0]] - m[..., [1, 2, 0], [2, 0, 1]]
    even = m[..., [2, 0, 1], [1, 2, 0]] + m[..., [1, 2, 0], [2, 0, 1]]
    # Rows are the quaternion times 4 w, 4 x, 4 y, 4 z; that of the largest component is the most exact.
    rows = np.empty((*m.shape[:-2], 4, 4))
    rows[..., 0, 0], rows[..., 0, 1:], rows[..., 1:, 0] = 1.0 + trace, odd, odd
    for k in range(3):
        rows[..., 1 + k, 1 + k] = 1.0 + 2.0 * diagonal[..., k] - trace
        i, j = (k + 1) % 3, (k + 2) % 3
        rows[..., 1 + i, 1 + j] = rows[..., 1 + j, 1 + i] = even[..., k]
    best = np.argmax(rows[..., range(4), range(4)], axis=-1)
    largest = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(largest / np.linalg.norm(largest, axis=-1, keepdims=True))


def matrix_from_quat(quat_wxyz: ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(quat_wxyz, dtype=np.float64)
    columns = [quat_product(quat_product(q, [0.0, *axis]), quat_inverse(q))[..., 1:] for axis in np.eye(3)]
    return np.stack(columns, axis=-1)


def continuous_quat(quat_wxyz: ArrayLike) -> Floats:
    """The same rotations (T, 4) with the sign of each nearest to the one before it that is there."""
    q = np.array(quat_wxyz, dtype=np.float64)
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    flips = np.sum(q[there[1:]] * q[there[:-1]], axis=1) < 0.0
    q[there[1:][np.cumsum(flips) % 2 == 1]] *= -1.0
    return q


def mean_quat(quat_wxyz: ArrayLike) -> Floats:
    """The mean of rotations (N, 4), (4,): the dominant eigenvector of their quaternions' scatter.

    Source: F. L. Markley et al. 2007, "Averaging quaternions", J. Guidance, Control and Dynamics 30(4).
    """
    q = np.asarray(quat_wxyz, dtype=np.float64)
    return np.asarray(np.linalg.eigh(q.T @ q)[1][:, -1])


def body_rates(quat: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Angular velocity and acceleration in child axes (..., 3) from a quaternion and its derivatives (..., 4) in time.

    The quaternion may have any norm but zero: only its direction counts.
    """
    square = np.sum(quat * quat, axis=-1, keepdims=True)
    velocity = 2.0 * quat_product(quat_inverse(quat), first)[..., 1:] / square
    growth = 2.0 * np.sum(quat * first, axis=-1, keepdims=True) / square
    acceleration = 2.0 * quat_product(quat_inverse(quat), second)[..., 1:] / square - growth * velocity
    return velocity, acceleration


def unit_quats(value: ArrayLike, where: str) -> Floats:
    """Quaternions (T, 4), checked and made unit; a row with a NaN becomes NaN.

    Args:
        value: quat_wxyz, one row per instant.
        where: names the array in an error.

    Raises:
        DataError: another shape, or a norm that is not near 1.
    """
    given = real_array(value, (None, 4), where)
    norm = np.linalg.norm(given, axis=1, keepdims=True)
    off = np.flatnonzero(np.abs(norm[:, 0] - 1.0) > NORM_TOLERANCE)
    if off.size:
        raise DataError(
            f"{where}[{off[0]}] has norm {norm[off[0], 0]:.4g}; expected unit quaternions, w first "
            f"({off.size} of {len(given)} rows are none). Use NaN for a missing one."
        )
    return np.asarray(given / norm)
