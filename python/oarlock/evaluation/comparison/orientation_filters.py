"""Published orientation filters for a single inertial unit, called through their packages.

World axes are north-west-up: x along magnetic north, z up. Settings are the defaults of the packages.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from oarlock.evaluation.comparison.single_units import UnitSegment
from oarlock.model.rotation import quat_from_matrix, quat_product
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

START_S = 2.0

INSTALL = "pip install 'oarlock[compare]'"

_HALF = np.sqrt(0.5)
NORTH_WEST_UP_FROM_EAST_NORTH_UP = np.array([_HALF, 0.0, 0.0, -_HALF])


def package(name: str) -> ModuleType:
    """An optional package.

    Raises:
        DataError: it is not installed.
    """
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise DataError(f"this filter needs the package {name}: {INSTALL}") from None


def upright(accel_m_s2: Floats, mag_ut: Floats) -> Floats:
    """Quaternions (..., 4) from two vectors: up along the specific force, north along the horizontal part of the field.

    Source: H. D. Black (1964), "A passive system for determining the attitude of a satellite" (TRIAD).
    """
    up = _unit(accel_m_s2)
    north = _unit(mag_ut - np.sum(mag_ut * up, axis=-1, keepdims=True) * up)
    return quat_from_matrix(np.stack([north, np.cross(up, north), up], axis=-2))


def begun(stretch: UnitSegment) -> Floats:
    """The first quaternion (4,): both vectors, rotated back by the gyroscope and averaged over `START_S`.

    A single sample of a moving unit may be wrong by half a radian, from which slow filters need many seconds to
    recover.
    """
    from scipy.spatial.transform import Rotation  # takes 0.15 s to import, and `track` imports this module

    count = min(len(stretch.time_s), max(1, round(START_S / stretch.step_s)))
    turned = Rotation.identity()
    sums = np.zeros((2, 3))
    for i in range(count):
        if i:
            turned = turned * Rotation.from_rotvec(stretch.gyro_rad_s[i] * stretch.step_s)
        for k, vector in enumerate((stretch.accel_m_s2[i], stretch.mag_ut[i])):
            sums[k] += turned.apply(vector) if np.isfinite(vector).all() else 0.0
    return upright(sums[0], sums[1])


def vqf(stretch: UnitSegment, dip_rad: float) -> Floats:
    """VQF: D. Laidig and T. Seel (2023), Information Fusion 91, with its default settings; it finds the dip itself."""
    made = package("vqf").VQF(stretch.step_s)
    gyro, accel, mag = (
        np.ascontiguousarray(x) for x in (stretch.gyro_rad_s, stretch.accel_m_s2, stretch.mag_ut)
    )
    there = _whole(mag)
    if there.all():
        quats = np.asarray(made.updateBatch(gyro, accel, mag)["quat9D"])
    else:
        quats = np.empty((len(gyro), 4))
        for i in range(len(gyro)):
            made.update(gyro[i], accel[i], mag[i]) if there[i] else made.update(gyro[i], accel[i])
            quats[i] = made.getQuat9D()
    return quat_product(NORTH_WEST_UP_FROM_EAST_NORTH_UP, quats)


def madgwick(stretch: UnitSegment, dip_rad: float) -> Floats:
    """Madgwick's gradient descent (2010), as in `ahrs` with its default gain; it finds the dip itself."""
    made = package("ahrs").filters.Madgwick(Dt=stretch.step_s)
    made.gain = made.gain_marg
    there = _whole(stretch.mag_ut)
    quats = np.empty((len(there), 4))
    quats[0] = begun(stretch)
    rows = zip(stretch.gyro_rad_s, stretch.accel_m_s2, stretch.mag_ut, strict=True)
    for i, (gyro, accel, mag) in enumerate(rows):
        if i and there[i]:
            quats[i] = made.updateMARG(quats[i - 1], gyro, accel, mag)
        elif i:
            quats[i] = made.updateIMU(quats[i - 1], gyro, accel)
    return quats


def quaternion_ekf(stretch: UnitSegment, dip_rad: float) -> Floats:
    """Extended Kalman filter on the quaternion, as in `ahrs` with its default noise.

    The two directions are its measurement (A. M. Sabatini 2011, "Kalman-filter-based orientation determination").
    """
    field = np.array([np.cos(dip_rad), 0.0, -np.sin(dip_rad)])
    # `frame` only sets the sign of gravity: with "NED" an upright unit at rest reads +z, as in our convention
    made = package("ahrs").filters.EKF(Dt=stretch.step_s, frame="NED", magnetic_ref=field, mag=np.zeros(3))
    there = _whole(stretch.mag_ut)
    quats = np.empty((len(there), 4))
    quats[0] = begun(stretch)
    rows = zip(stretch.gyro_rad_s, stretch.accel_m_s2, stretch.mag_ut, strict=True)
    for i, (gyro, accel, mag) in enumerate(rows):
        if i:
            made.mag = mag if there[i] else None
            quats[i] = made.update(quats[i - 1], gyro, accel, mag if there[i] else None)
    return quats


def _whole(vectors: Floats) -> Bools:
    return np.asarray(np.isfinite(vectors).all(axis=1))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
