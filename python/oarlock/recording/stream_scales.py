"""How one stream's stamps and readings differ from true time and true values."""

from dataclasses import dataclass
from math import isfinite, isnan, nan

from oarlock import _core
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError

MOST_DRIFT = 0.1
"""A clock that gains a tenth is none; a figure that large was meant in ppm."""


@dataclass(frozen=True)
class Clock:
    """A stream's clock: at true time t its stamp reads ``t + offset_s + drift * t``.

    Args:
        offset_s: stamp less true time at t = 0 of the recording's own time axis, s.
        drift: by how much it gains, s per s: 50 ppm are 5e-5.
        offset_std_s: standard deviation of the offset, s; NaN if it is not known.
        drift_std: standard deviation of the drift; NaN if it is not known.

    Raises:
        DataError: a figure that is not finite, a drift of 0.1 or more, a negative standard deviation.
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
                f"clock, drift: is {self.drift:g}; expected a share below {MOST_DRIFT:g}: 50 ppm are 5e-5"
            )
        for name in ("offset_std_s", "drift_std"):
            std = _number(getattr(self, name), f"clock, {name}")
            if not (isnan(std) or (isfinite(std) and std >= 0.0)):
                raise DataError(f"clock, {name}: is {std:g}; expected 0 or more, or NaN for unknown")

    def true_s(self, stamps_s: FloatArray) -> FloatArray:
        """(T,) true times, s, of (T,) stamps, s; the same bits where offset and drift are zero."""
        return _core.true_times_s(self, stamps_s)

    def stamps_s(self, true_s: FloatArray) -> FloatArray:
        """(T,) what the clock reads, s, at (T,) true times, s."""
        return true_s + self.offset_s + self.drift * true_s


@dataclass(frozen=True)
class EncoderScale:
    """A scalar stream's zero and scale: ``value = scale * (reading - zero)``.

    Args:
        zero: what it reads where the value is zero, in the stream's unit (rad, m).
        scale: value per reading; -1 is a wrong sign.

    Raises:
        DataError: a figure that is not finite, or a scale of zero.
    """

    zero: float
    scale: float = 1.0

    def __post_init__(self) -> None:
        _finite(self.zero, "encoder, zero", "rad or m")
        _finite(self.scale, "encoder, scale", "value per reading")
        if self.scale == 0.0:
            raise DataError(
                "encoder, scale: is 0, which would wipe out every reading; expected 1, -1 or near"
            )

    def value(self, readings: FloatArray) -> FloatArray:
        """(T,) values of (T,) readings, rad or m; NaN stays NaN."""
        return _core.encoder_values(self, readings)


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{where}: is {value!r}; expected a number")
    try:
        return float(value)
    except OverflowError:
        raise DataError(f"{where}: is larger than any number with a decimal point") from None


def _finite(value: object, where: str, unit: str) -> None:
    number = _number(value, where)
    if not isfinite(number):
        raise DataError(f"{where}: is {number:g}; expected a finite number ({unit})")
