"""Linear Kalman filter on the directions of gravity and magnetic field in the axes of a single unit.

After R. Zhu and Z. Zhou (2004), "A real-time articulated human motion tracking using tri-axis inertial/magnetic sensors
package", IEEE Transactions on Neural Systems and Rehabilitation Engineering 12(2). The gyroscope rotates both vectors,
accelerometer and magnetometer measure them, and their directions give the orientation.
"""

from __future__ import annotations

import numpy as np

from oarlock.evaluation.comparison.orientation_filters import begun, upright
from oarlock.evaluation.comparison.single_units import UnitSegment
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats

GYRO_STD_RAD_S, ACCEL_STD, MAG_STD = 0.3, 0.5, 0.8
"""Noise of the Kalman filter in `ahrs`, including motion; the last two are of vectors of length 1."""


def vector_kf(stretch: UnitSegment, dip_rad: float) -> Floats:
    """Quaternions (T, 4). Noise is equal in all directions, so each vector's covariance is a number."""
    measured = np.stack([stretch.accel_m_s2, stretch.mag_ut], axis=2)
    measured /= np.linalg.norm(measured, axis=1, keepdims=True)
    there = np.asarray(np.isfinite(measured).all(axis=1))
    noise = np.array([ACCEL_STD, MAG_STD]) ** 2
    growth = (GYRO_STD_RAD_S * stretch.step_s) ** 2
    back = np.swapaxes(matrix_from_quat(quat_from_rotvec(stretch.gyro_rad_s * stretch.step_s)), 1, 2)
    vectors, variance = _seen_from(begun(stretch), dip_rad), noise
    found = np.empty_like(measured)
    found[0] = vectors
    for i in range(1, len(found)):
        vectors, variance = back[i] @ vectors, variance + growth
        gain = np.where(there[i], variance / (variance + noise), 0.0)
        vectors = vectors + gain * np.where(there[i], measured[i] - vectors, 0.0)
        variance = variance * (1.0 - gain)
        found[i] = vectors
    return upright(found[:, :, 0], found[:, :, 1])


def _seen_from(quat: Floats, dip_rad: float) -> Floats:
    """Up and the field's direction in the unit's axes, (3, 2)."""
    field = np.array([np.cos(dip_rad), 0.0, -np.sin(dip_rad)])
    return np.asarray(matrix_from_quat(quat).T @ np.column_stack([[0.0, 0.0, 1.0], field]))
