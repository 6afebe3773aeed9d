"""Checks of the values of a `Calibration`. Each is copied read-only or refused with field, name, number and unit."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

Mount: TypeAlias = tuple[Floats, Floats]

# Rotations typed by hand have four to six digits; the error of a wrong matrix is far larger.
ROTATION_TOLERANCE = 1e-4

LEAST_DETERMINANT = 1e-3
"""A soft-iron matrix changes the axes by some percent; a matrix with a smaller determinant has lost an axis."""


def finite_parameter(value: ArrayLike, name: str) -> float:
    """The value of a parameter, m or rad, checked to be finite."""
    number = real_array(value, (), f'calibration, parameter "{name}"').item()
    if not np.isfinite(number):
        raise DataError(f'calibration, parameter "{name}": is {number}; expected a finite number')
    return float(number)


def parameter_std(value: ArrayLike, name: str) -> float:
    """The standard deviation of a parameter, m or rad, checked to be finite and 0 or more."""
    where = f'calibration, parameter_stds of "{name}"'
    number = real_array(value, (), where).item()
    if not (np.isfinite(number) and number >= 0.0):
        raise DataError(f"{where}: is {number}; expected a finite number, 0 or more, in m or rad")
    return float(number)


def finite_three(value: ArrayLike, field: str, name: str, unit: str) -> Floats:
    """(3,) values of one sensor, checked to be finite."""
    where = f'calibration, {field} of "{name}"'
    three = real_array(value, (3,), where)
    if not np.isfinite(three).all():
        raise DataError(f"{where}: is {three.tolist()}; expected three finite numbers in {unit}")
    return three


def std_three(value: ArrayLike, field: str, name: str, unit: str) -> Floats:
    """(3,) standard deviations of one sensor, checked to be 0 or more."""
    three = finite_three(value, field, name, unit)
    if (three < 0.0).any():
        raise DataError(
            f'calibration, {field} of "{name}": is {three.tolist()}; '
            f"a standard deviation is 0 or more, in {unit}"
        )
    return three


def accel_scale(value: ArrayLike, name: str) -> Floats:
    """(3,) scale factors of an accelerometer (reading per true m/s2), checked to be positive."""
    three = finite_three(value, "accel_scales", name, "reading per m/s2")
    if (three <= 0.0).any():
        raise DataError(
            f'calibration, accel_scales of "{name}": is {three.tolist()}; expected positive numbers near 1. '
            "Describe an inverted axis in the mount"
        )
    return three


def mag_matrix(value: ArrayLike, name: str) -> Floats:
    """(3, 3) soft-iron correction, checked to be finite and to have a positive determinant."""
    where = f'calibration, mag_matrices of "{name}"'
    matrix = real_array(value, (3, 3), where)
    if not np.isfinite(matrix).all():
        raise DataError(f"{where}: is {matrix.tolist()}; expected nine finite numbers")
    with np.errstate(over="ignore", invalid="ignore"):
        determinant = float(np.linalg.det(matrix))
    if not LEAST_DETERMINANT <= determinant < np.inf:
        raise DataError(
            f"{where}: has determinant {determinant:.3g}; expected about 1. Below {LEAST_DETERMINANT:g} the "
            "matrix flattens the field; a negative determinant mirrors it"
        )
    return matrix


def checked_mount(value: object, name: str) -> Mount:
    """The mount (link_from_sensor (3, 3), offset_m (3,)), checked to be a rotation and finite numbers."""
    where = f'calibration, mount of "{name}"'
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise DataError(f"{where}: expected (link_from_sensor 3x3, offset_m 3), got {value!r}")
    rotation, offset = value
    link_from_sensor = real_array(rotation, (3, 3), f"{where}, rotation")
    offset_m = real_array(offset, (3,), f"{where}, offset_m")
    if not np.isfinite(offset_m).all():
        raise DataError(f"{where}: offset_m is {offset_m.tolist()}; expected finite numbers")
    _check_rotation(link_from_sensor, where)
    return link_from_sensor, offset_m


def _check_rotation(matrix: Floats, where: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not error <= ROTATION_TOLERANCE:
        raise DataError(
            f"{where}: rows are not orthonormal (R R^T is off by {error:.3g}, allowed {ROTATION_TOLERANCE:g}). Give "
            "more digits, or use the nearest rotation."
        )
    if np.linalg.det(matrix) < 0:
        raise DataError(f"{where}: is a mirror (determinant -1), not a rotation. Check the sign of one axis.")
