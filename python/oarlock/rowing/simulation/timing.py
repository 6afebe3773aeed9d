"""Stroke rate, drive ratio and phase of simulated strokes over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from oarlock.rowing.simulation.curves import Variation
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

RATE_RANGE_SPM = (16.0, 45.0)
DRIVE_RATIO_RANGE = (0.32, 0.60)
_PERIOD_SD = 0.01
_DRIVE_RATIO_SD = 0.004
# 36 % of the cycle at 20 strokes per minute, 45 % at 34: the range that scullers show.
_DRIVE_RATIO_AT_20_SPM = 0.36
_DRIVE_RATIO_PER_SPM = 0.09 / 14.0


@dataclass(frozen=True, eq=False)
class StrokeTiming:
    """The course of the strokes over time; all arrays are (K,).

    ``stroke`` counts strokes continuously, whole numbers at the catch. ``phase`` counts them too, but is
    warped so that the drive fills its first half: k at catch number k, k + 0.5 at the finish.
    """

    time_s: Floats
    rate_spm: Floats
    drive_ratio: Floats
    stroke: Floats
    phase: Floats

    @property
    def first_stroke(self) -> slice:
        """Knots from the first catch to the next, both included; empty if there is no whole stroke."""
        whole = np.searchsorted(self.stroke, [np.ceil(self.stroke[0]), np.ceil(self.stroke[0]) + 1.0])
        return slice(int(whole[0]), int(whole[1]) + 1) if whole[1] < self.stroke.size else slice(0, 0)


def _checked_rates(rate_spm: float | Sequence[float]) -> Floats:
    rates = np.atleast_1d(np.asarray(rate_spm, dtype=np.float64))
    low, high = RATE_RANGE_SPM
    if rates.ndim != 1 or rates.size == 0 or not ((rates >= low) & (rates <= high)).all():
        raise DataError(
            f"rate_spm is {rate_spm}; give one rate or a sequence of rates, each from {low:g} to {high:g} "
            "strokes per minute (racing is 34 to 40)"
        )
    return rates


def _checked_drive_ratio(drive_ratio: float) -> float:
    low, high = DRIVE_RATIO_RANGE
    if not low <= drive_ratio <= high:
        raise DataError(
            f"drive_ratio is {drive_ratio}; the drive must take {low:g} to {high:g} of the cycle "
            "(scullers: 0.36 to 0.45), or None to let it grow with the rate"
        )
    return float(drive_ratio)


def _rate_profile(rates: Floats, time_s: Floats) -> BSpline:
    """A Bernstein polynomial: starts at the first rate, ends at the last, never leaves their range."""
    degree = rates.size - 1
    ends = np.array([time_s[0], time_s[-1]])
    return BSpline(np.repeat(ends, degree + 1), rates, degree)


def warp(stroke: Floats, drive_ratio: Floats | np.float64) -> Floats:
    """Phase (K,) that is 0 at the catch and 0.5 at the finish, from the share of the cycle passed."""
    strength = (0.5 - drive_ratio) / (1.0 - np.cos(2.0 * np.pi * drive_ratio))
    return np.asarray(stroke + strength * (1.0 - np.cos(2.0 * np.pi * stroke)), dtype=np.float64)


def stroke_timing(
    time_s: Floats,
    rate_spm: float | Sequence[float],
    drive_ratio: float | None,
    variation: float,
    rng: np.random.Generator,
) -> StrokeTiming:
    """Strokes over times (K,) s, the first catch at the first time.

    `rate_spm` is in strokes per minute; a sequence is passed smoothly over the whole duration, two rates make a linear
    ramp. `drive_ratio` is the share of the cycle from catch to finish; None: 0.36 at 20 spm to 0.45 at 34. With
    `variation` 1 periods have a standard deviation of 1 %, as those of good scullers.

    Raises:
        DataError: a rate or a ratio out of range.
    """
    profile = _rate_profile(_checked_rates(rate_spm), time_s)
    rate = np.asarray(profile(time_s), dtype=np.float64)
    count = profile.antiderivative()
    stroke = np.asarray(count(time_s) - count(time_s[0]), dtype=np.float64) / 60.0
    vary = Variation(rng, stroke)
    lag = vary.draw(variation * _PERIOD_SD)
    ratio = (
        _DRIVE_RATIO_AT_20_SPM + _DRIVE_RATIO_PER_SPM * (rate - 20.0)
        if drive_ratio is None
        else np.full_like(rate, _checked_drive_ratio(drive_ratio))
    )
    stroke = stroke + lag - lag[0]
    ratio = ratio + vary.draw(variation * _DRIVE_RATIO_SD)
    return StrokeTiming(time_s, rate, ratio, stroke, warp(stroke, ratio))
