"""Mean of numbers in order of time, with a standard error that allows for like neighbours. For `crew_timing`."""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.statistics import robust_std, student_quantile

FEWEST = 5
"""Strokes that a mean needs."""
_OUTLIER_SIGMAS = 5.0
_MOST_ALIKE = 0.9


class Mean(NamedTuple):
    """A mean of strokes.

    Attributes:
        mean, standard_error: in the unit of the values; NaN below `FEWEST`.
        df: degrees of freedom of the standard error.
        sd: standard deviation of a stroke, measurement included.
        noise: what the measurement contributes to it, root mean square.
        strokes: strokes that count.
    """

    mean: float
    standard_error: float
    df: float
    sd: float
    noise: float
    strokes: int

    @property
    def own_sd(self) -> float:
        """Standard deviation of a stroke without the measurement's."""
        return float(np.sqrt(max(self.sd**2 - self.noise**2, 0.0)))

    def half_width(self, share: float, systematic: float) -> float:
        """Half of the band that contains the truth with probability `share`, with an error that all strokes share."""
        tail = 0.5 + 0.5 * share
        if not np.isfinite(systematic) or self.strokes < FEWEST:
            return float("nan")
        return float(
            np.hypot(
                student_quantile(tail, self.df) * self.standard_error, NormalDist().inv_cdf(tail) * systematic
            )
        )


def mean_of(values: Floats, stds: Floats) -> Mean:
    """The mean of values (N,) in order of time; NaN is missing. `stds` are of the measurement.

    A value counts by 1 / (variance of strokes + its own variance). Those beyond five robust standard deviations are
    left out: a catch that was no catch.
    """
    good = np.isfinite(values) & np.isfinite(stds)
    good &= _near(values, stds, good)
    x, noise2 = values[good], stds[good] ** 2
    if len(x) < FEWEST:
        return Mean(np.nan, np.nan, 1.0, np.nan, np.nan, len(x))
    sd2 = float(np.var(x, ddof=1))
    weight = 1.0 / np.maximum(max(sd2 - float(np.mean(noise2)), 0.0) + noise2, 1e-12)
    weight /= weight.sum()
    mean = float(weight @ x)
    off = x - mean
    more = inflation(off)
    n_own = 1.0 / float(np.sum(weight**2))
    variance = float(np.sum(weight**2 * off**2)) * more * n_own / max(n_own - 1.0, 1.0)
    df = max(n_own / more - 1.0, 2.0)
    noise = float(np.sqrt(np.mean(noise2)))
    return Mean(mean, float(np.sqrt(variance)), df, float(np.sqrt(sd2)), noise, len(x))


def inflation(off: Floats) -> float:
    """How much larger the variance of a mean is because neighbours resemble each other; at least 1.

    The larger of two estimates: Bartlett's weights over the first lags (Newey and West 1987), and a first-order
    autoregression whose coefficient is corrected for the short series (Kendall 1954). The first is too small for short
    series, the second for slow swings.
    """
    n = len(off)
    power = float(off @ off)
    lags = min(int(2.0 * n ** (1.0 / 3.0)), n // 3)
    if power == 0.0 or lags < 1:
        return 1.0
    alike = np.array([float(off[k:] @ off[:-k]) / power for k in range(1, lags + 1)]) + 1.0 / n
    bartlett = 1.0 + 2.0 * float(alike @ (1.0 - np.arange(1, lags + 1) / (lags + 1)))
    first = min(float(alike[0]) + 3.0 * max(float(alike[0]), 0.0) / n, _MOST_ALIKE)
    return max(bartlett, (1.0 + first) / (1.0 - first), 1.0)


def _near(values: Floats, stds: Floats, good: Bools) -> Bools:
    if not good.any():
        return good
    centre = float(np.median(values[good]))
    spread = max(robust_std(values[good] - centre), float(np.median(stds[good])), 1e-3)
    return np.abs(np.where(good, values, centre) - centre) <= _OUTLIER_SIGMAS * spread
