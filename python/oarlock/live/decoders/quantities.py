"""Units and checks of what devices send, for the decoders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from oarlock.live.reading import Value
from oarlock.storage.units import STANDARD_GRAVITY_M_S2

_LENGTHS: Mapping[str, int] = MappingProxyType(
    {"gyro_rad_s": 3, "accel_m_s2": 3, "mag_ut": 3, "mag_arbitrary": 3, "position_m": 3, "quat_wxyz": 4}
)
_NORM_TOLERANCE = 0.01
"""Of quaternions, as the file readers have it."""


def radians(values: Iterable[float]) -> tuple[float, ...]:
    """Degrees (a second) as radians (a second)."""
    return tuple(value * math.pi / 180.0 for value in values)


def from_gravities(values: Iterable[float]) -> tuple[float, ...]:
    """Multiples of standard gravity as m/s2."""
    return tuple(value * STANDARD_GRAVITY_M_S2 for value in values)


def quat_from_roll_pitch_yaw(angles_deg: tuple[float, ...]) -> tuple[float, ...]:
    """The quaternion of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = (0.5 * angle for angle in radians(angles_deg))
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def are_sound(values: Mapping[str, Value]) -> bool:
    """Whether all numbers are finite, vectors are as long as their names say, and quaternions have the norm 1."""
    return all(_is_sound(name, value) for name, value in values.items())


def _is_sound(name: str, value: Value) -> bool:
    if isinstance(value, str):
        return name not in _LENGTHS
    numbers = value if isinstance(value, tuple) else (value,)
    if not all(map(math.isfinite, numbers)):
        return False
    length = _LENGTHS.get(name)
    if length is not None and (not isinstance(value, tuple) or len(value) != length):
        return False
    return name != "quat_wxyz" or abs(math.hypot(*numbers) - 1.0) <= _NORM_TOLERANCE
