"""`Clock` and `EncoderScale`: corrections of one stream's time stamps and readings. Fields of `Calibration`."""

from dataclasses import dataclass
from math import isfinite, isnan, nan

from oarlock import _core
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

MOST_DRIFT = 0.1
"""No clock drifts by a tenth; a larger value was probably given in ppm."""


@dataclass(frozen=True)
class Clock:
    """A stream's clock: at true time t the time stamp is ``t + offset_s + drift * t``.

    Args:
        offset_s: time stamp minus true time at t = 0 of the recording's time axis, s.
        drift: relative rate error, s per s: 50 ppm are 5e-5.
        offset_std_s: standard deviation of the offset, s; NaN if unknown.
        drift_std: standard deviation of the drift, s per s; NaN if unknown.

    Raises:
        DataError: a number is not finite, the drift is 0.1 or more, or a standard deviation is negative.
    """

    offset_s: float
    drift: float = 0.0
    offset_std_s: float = nan
    drift_std: float = nan

    def __post_init__(self) -> None:
        _finite(self.offset_s, "clock, offset_s", "s")
        _finite(self.drift, "clock, drift", "s per s")
        if abs(self.drift) >= MOST_DRIFT:
            raise DataError(
                f"clock, drift: is {self.drift:g}; expected less than {MOST_DRIFT:g} s per s: 50 ppm are 5e-5"
            )
        for name in ("offset_std_s", "drift_std"):
            std = _number(getattr(self, name), f"clock, {name}")
            if not (isnan(std) or (isfinite(std) and std >= 0.0)):
                raise DataError(f"clock, {name}: is {std:g}; expected 0 or more, or NaN for unknown")

    def true_s(self, stamps_s: Floats) -> Floats:
        """(T,) true times, s, from (T,) time stamps, s; identical to them if offset and drift are zero."""
        return _core.true_times_s(self, stamps_s)

    def stamps_s(self, true_s: Floats) -> Floats:
        """(T,) time stamps of this clock, s, at (T,) true times, s."""
        return true_s + self.offset_s + self.drift * true_s


@dataclass(frozen=True)
class EncoderScale:
    """Zero and scale of a scalar stream: ``value = scale * (reading - zero)``.

    Args:
        zero: reading where the true value is zero, in the stream's unit (rad, m).
        scale: true value per reading; -1 corrects a wrong sign.

    Raises:
        DataError: a number is not finite, or the scale is zero.
    """

    zero: float
    scale: float = 1.0

    def __post_init__(self) -> None:
        _finite(self.zero, "encoder, zero", "rad or m")
        _finite(self.scale, "encoder, scale", "value per reading")
        if self.scale == 0.0:
            raise DataError("encoder, scale: is 0, which makes every value 0; expected a number near 1 or -1")

    def value(self, readings: Floats) -> Floats:
        """(T,) corrected values of (T,) readings, rad or m; NaN remains NaN."""
        return _core.encoder_values(self, readings)


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{where}: is {value!r}; expected a number")
    try:
        return float(value)
    except OverflowError:
        raise DataError(f"{where}: is too large for a floating-point number") from None


def _finite(value: object, where: str, unit: str) -> None:
    number = _number(value, where)
    if not isfinite(number):
        raise DataError(f"{where}: is {number:g}; expected a finite number ({unit})")
