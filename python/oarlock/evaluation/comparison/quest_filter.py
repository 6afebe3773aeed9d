"""Kalman filter on angular rate and quaternion of a single unit, with quaternions from QUEST as measurements.

After X. Yun and E. R. Bachmann (2006), "Design, implementation, and experimental results of a quaternion-based Kalman
filter for human body motion tracking", IEEE Transactions on Robotics 22(6). A quaternion is first computed from
accelerometer and magnetometer, so that the measurement (rates and quaternion) is linear. Rates are a Gauss-Markov
process. The noise in the paper is that of its sensors; the constants below are ours.
"""

from __future__ import annotations

import numpy as np

from oarlock.evaluation.comparison.orientation_filters import begun, package
from oarlock.evaluation.comparison.single_units import UnitSegment
from oarlock.evaluation.comparison.vector_filter import ACCEL_STD, GYRO_STD_RAD_S
from oarlock.model.rotation import quat_product
from oarlock.storage.arrays import Floats

RATE_STD_RAD_S, RATE_MEMORY_S = 5.0, 0.5
"""Standard deviation of limbs' angular rates, rad/s, and their correlation time, s."""

QUATERNION_STD = ACCEL_STD / 2
"""Standard deviation of QUEST's quaternion: half the angle by which motion rotates the measured vertical."""


def quest_ekf(stretch: UnitSegment, dip_rad: float) -> Floats:
    """Quaternions (T, 4)."""
    measured = _quest(stretch, dip_rad)
    quats = np.empty_like(measured)
    quat, rate = begun(stretch), stretch.gyro_rad_s[0]
    covariance = np.diag([GYRO_STD_RAD_S**2] * 3 + [QUATERNION_STD**2] * 4)
    forget = np.exp(-stretch.step_s / RATE_MEMORY_S)
    driven = RATE_STD_RAD_S**2 * (1.0 - forget**2)
    quats[0] = quat
    for i in range(1, len(quats)):
        rate = forget * rate
        covariance[:3, :] *= forget
        covariance[:, :3] *= forget
        covariance[range(3), range(3)] += driven
        mean = np.concatenate([rate, quat])
        mean, covariance = _read(mean, covariance, slice(0, 3), stretch.gyro_rad_s[i], GYRO_STD_RAD_S**2)
        mean, covariance = _turned(mean, covariance, stretch.step_s)
        if np.isfinite(measured[i]).all():
            reading = measured[i] if measured[i] @ mean[3:] >= 0.0 else -measured[i]
            mean, covariance = _read(mean, covariance, slice(3, 7), reading, QUATERNION_STD**2)
        rate, quat = mean[:3], mean[3:] / np.linalg.norm(mean[3:])
        quats[i] = quat
    return quats


def _quest(stretch: UnitSegment, dip_rad: float) -> Floats:
    """QUEST's quaternion at each instant; NaN without a magnetometer. `ahrs` uses north-east-down axes."""
    solver = package("ahrs").filters.QUEST(magnetic_dip=float(np.degrees(dip_rad)))
    found = np.full((len(stretch.time_s), 4), np.nan)
    for i in np.flatnonzero(np.isfinite(stretch.mag_ut).all(axis=1)):
        found[i] = solver.estimate(-stretch.accel_m_s2[i], stretch.mag_ut[i])
    return quat_product([0.0, 1.0, 0.0, 0.0], found)


def _read(
    mean: Floats, covariance: Floats, which: slice, value: Floats, noise: float
) -> tuple[Floats, Floats]:
    """The update by a direct reading of some states."""
    innovation = covariance[which, which] + noise * np.eye(len(value))
    gain = np.linalg.solve(innovation, covariance[which]).T
    return mean + gain @ (value - mean[which]), covariance - gain @ covariance[which]


def _turned(mean: Floats, covariance: Floats, step_s: float) -> tuple[Floats, Floats]:
    """The quaternion after a step with the given rates, to first order as in the source."""
    (x, y, z), (qw, qx, qy, qz) = 0.5 * step_s * mean[:3], mean[3:]
    change = np.eye(7)
    change[3:, 3:] += [[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]]
    moved = change[3:, 3:] @ mean[3:]
    change[3:, :3] = 0.5 * step_s * np.array([[-qx, -qy, -qz], [qw, -qz, qy], [qz, qw, -qx], [-qy, qx, qw]])
    return np.concatenate([mean[:3], moved]), change @ covariance @ change.T
