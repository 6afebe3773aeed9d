"""Checks the values of a session plan. A wrong value is refused with its location and the expected kind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from oarlock.storage.array_gate import real_array
from oarlock.storage.errors import DataError

Axis = tuple[float, float, float]


def text(value: object, where: str) -> str:
    """A text.

    Raises:
        DataError: something else.
    """
    if not isinstance(value, str):
        raise DataError(f"{where}: is {_shown(value)}; expected a text")
    return value


def yes_or_no(value: object, where: str) -> bool:
    """True or false.

    Raises:
        DataError: something else.
    """
    if not isinstance(value, bool):
        raise DataError(f"{where}: is {_shown(value)}; expected true or false")
    return value


def finite(value: object, where: str) -> float:
    """A finite number.

    Raises:
        DataError: something else.
    """
    number = float(real_array(value, (), where))  # type: ignore[arg-type]
    if not np.isfinite(number):
        raise DataError(f"{where}: is {number:g}; expected a finite number")
    return number


def posture_std(value: object, where: str) -> float:
    """A posture's standard deviation, rad.

    Raises:
        DataError: not between 0 and 1.
    """
    std_rad = finite(value, where)
    if not 0.0 < std_rad < 1.0:
        raise DataError(f"{where} = {std_rad:g}; expected radians between 0 and 1, for example 0.052 (3 deg)")
    return std_rad


def one_way(value: object, where: str) -> int:
    """1 or -1.

    Raises:
        DataError: something else.
    """
    if not isinstance(value, int | float | np.integer | np.floating) or value not in (1, -1):
        raise DataError(f"{where} = {_shown(value)}; expected 1 or -1")
    return int(value)


def names(value: object, where: str) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        DataError: something else.
    """
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise DataError(f"{where}: is {_shown(value)}; expected a list of names, such as ['elbow_flexion']")
    return tuple(text(name, f"{where}[{k}]") for k, name in enumerate(value))


def posture(value: object, where: str) -> dict[str, float]:
    """Values by coordinate, rad or m.

    Raises:
        DataError: no table, or one of anything but names and finite numbers.
    """
    if not isinstance(value, Mapping):
        raise DataError(
            f"{where}: is {_shown(value)}; expected a table, such as {{ elbow_flexion = 1.5708 }}"
        )
    return {
        text(name, f"{where}, a name"): finite(angle, f'{where}, "{name}"') for name, angle in value.items()
    }


def axis(value: object, where: str) -> Axis:
    """A direction.

    Raises:
        DataError: no three finite numbers, or all of them 0.
    """
    x, y, z = (float(v) for v in real_array(value, (3,), where))  # type: ignore[arg-type]
    length = float(np.hypot(np.hypot(x, y), z))
    if not (np.isfinite(length) and length > 0.0):
        raise DataError(f"{where}: is [{x:g}, {y:g}, {z:g}]; expected a direction, such as [0, 0, 1]")
    return x, y, z


def _shown(value: object) -> str:
    shown = repr(value)
    return shown if len(shown) < 60 else f"{shown[:57]}..."
