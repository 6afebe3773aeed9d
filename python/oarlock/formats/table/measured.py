"""Units of measurement of a table whose header names none: from gravity and the rotation of gravity. Never guessed.

The streams were read as if their numbers were in rad/s, m/s2 and uT.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.formats.arbitrary_units import ARBITRARY
from oarlock.formats.choices import UnclearError
from oarlock.recording.gyro_scale import gyro_per_gravity_turn, row_norms
from oarlock.recording.plausibility import GYRO_MAX_RAD_S
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.units import ACCEL, GYRO

_AT_REST = {"g": (0.8, 1.2), "m/s2": (7.8, 11.8), "mg": (800.0, 1200.0), "mm/s2": (7800.0, 11800.0)}
"""|accel| of a unit that rests in each unit of measurement; 20 % either way for offsets and moderate motion."""
_MAG_NORMS = {"uT": (15.0, 100.0), "mG": (150.0, 1000.0), "nT": (15_000.0, 100_000.0)}
"""The earth's field of 22 to 67 uT, half more for iron. Near 1 it may be gauss or normalised: arbitrary."""
_RATIO = (0.6, 1.6)
_DEG_PER_RAD = 180.0 / np.pi


def accel_unit(place: str, units: Sequence[ImuStream]) -> tuple[str, str]:
    """Unit of the accelerometers, and a sentence with the reason.

    Raises:
        UnclearError: the norms fit no unit, or the units differ.
    """
    norms = [_usual_norm(one.accel_m_s2) for one in units if one.accel_m_s2 is not None]
    fits = {next((u for u, (low, high) in _AT_REST.items() if low <= norm <= high), None) for norm in norms}
    if len(fits) == 1 and (unit := fits.pop()) is not None:
        return unit, f"{place}: accelerometer read as {unit}, because |accel| is usually {norms[0]:.3g}."
    shown = ", ".join(f"{norm:.3g}" for norm in norms)
    raise UnclearError(
        f"{place}: the unit of the accelerometer is not clear: the header names none, and |accel| is usually {shown}. "
        f"Give --accel-unit {'|'.join(ACCEL)}.",
        "accel_unit",
        {unit: f"|accel| would be {norms[0] / np.mean(_AT_REST[unit]):.3g} times gravity" for unit in ACCEL},
    )


def gyro_unit(place: str, units: Sequence[ImuStream]) -> tuple[str, str]:
    """Unit of the gyroscopes, and a sentence with the reason.

    Raises:
        UnclearError: gravity does not turn enough in the accelerometers to compare.
    """
    votes = {vote for one in units if (vote := _gyro_vote(one)) is not None}
    if len(votes) == 1:
        unit, reason = votes.pop()
        return unit, f"{place}: gyroscope read as {unit}, because {reason}."
    reasons = {unit for unit, _ in votes}
    if len(reasons) == 1:
        return (unit := reasons.pop()), f"{place}: gyroscope read as {unit}, because of its rates."
    tops = [_top(one.gyro_rad_s) for one in units]
    raise UnclearError(
        f"{place}: the unit of the gyroscope is not clear: the header names none, and the accelerometer shows too "
        f"little rotation to compare (fastest {max(tops, default=0.0):.3g}). Give --gyro-unit {'|'.join(GYRO)}.",
        "gyro_unit",
        {
            "rad/s": f"fastest rotation {max(tops, default=0.0) * _DEG_PER_RAD:.3g} deg/s",
            "deg/s": f"fastest rotation {max(tops, default=0.0):.3g} deg/s",
        },
    )


def mag_unit(place: str, units: Sequence[ImuStream]) -> tuple[str, str]:
    """Unit of the magnetometers, and a sentence with the reason. What fits no unit is arbitrary."""
    norms = [_usual_norm(one.mag_ut) for one in units if one.mag_ut is not None]
    fits = {
        next((u for u, (low, high) in _MAG_NORMS.items() if low <= norm <= high), ARBITRARY) for norm in norms
    }
    unit = fits.pop() if len(fits) == 1 else ARBITRARY
    return unit, f"{place}: magnetometer read as {unit}, because |mag| is usually {norms[0]:.3g}."


def _gyro_vote(one: ImuStream) -> tuple[str, str] | None:
    if one.gyro_rad_s is None:
        return None
    if (top := _top(one.gyro_rad_s)) > GYRO_MAX_RAD_S:
        return "deg/s", f"no unit on a body rotates at {top:.3g} rad/s"
    ratio = gyro_per_gravity_turn(one)
    if ratio is None:
        return None
    for unit, factor in (("rad/s", 1.0), ("deg/s", _DEG_PER_RAD)):
        if _RATIO[0] < ratio / factor < _RATIO[1]:
            return unit, "gravity in the accelerometer rotates as fast"
    return None


def _usual_norm(rows: Floats | None) -> float:
    """Median of the norms; NaN without readings."""
    if rows is None:
        return float("nan")
    norms = row_norms(rows)
    there = norms[np.isfinite(norms)]
    return float(np.median(there)) if there.size else float("nan")


def _top(rows: Floats | None) -> float:
    """Largest norm; 0 without readings."""
    norms = row_norms(rows) if rows is not None else np.zeros(0)
    there = norms[np.isfinite(norms)]
    return float(there.max()) if there.size else 0.0
