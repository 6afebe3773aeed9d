"""Robust scatter, and the chi-square, Student's, F and studentized range distributions, for every test and interval.

`scipy.special` has them too, but is not a required dependency and takes a quarter of a second to import.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from oarlock.storage.arrays import Floats

NORMAL_95 = 1.96
"""Half of a 95 % interval of a normal number, in standard deviations."""
STD_OF_MAD = 1.4826
"""Standard deviation of normal numbers over their median absolute deviation."""

# Below so many degrees of freedom the chi-square distribution's series is solved, above it the expansion is as good.
_MANY_DEGREES = 1000.0
_MOST_STEPS = 200


def robust_std(deviations: Floats) -> float:
    """Standard deviation of normal numbers from deviations (n,) off their centre, which outliers hardly change."""
    return STD_OF_MAD * float(np.median(np.abs(deviations)))


def chi2_quantile(probability: float, degrees: ArrayLike) -> Floats:
    """Quantile of the chi-square distribution, to 1e-11 of it.

    Source: Goldberg and Levine 1946, "Approximate formulas for the percentage points and normalization of t and chi
    squared" (expansion for many degrees of freedom); below 1000 the distribution's series (Abramowitz and Stegun 1964,
    6.5.29) is solved by Newton's method, in logarithms of both, where it converges from any start.
    """
    count = np.atleast_1d(np.asarray(degrees, dtype=np.float64))
    z, root = NormalDist().inv_cdf(probability), np.sqrt(2.0 * count)
    quantile = (
        count
        + z * root
        + 2.0 / 3.0 * (z**2 - 1.0)
        + (z**3 - 7.0 * z) / (9.0 * root)
        - (6.0 * z**4 + 14.0 * z**2 - 32.0) / (405.0 * count)
        + (9.0 * z**5 + 256.0 * z**3 - 433.0 * z) / (4860.0 * count * root)
        + (12.0 * z**6 - 243.0 * z**4 - 923.0 * z**2 + 1472.0) / (25515.0 * count**2)
        - (3753.0 * z**7 + 4353.0 * z**5 - 289517.0 * z**3 - 289717.0 * z) / (9185400.0 * count**2 * root)
    )
    few = count < _MANY_DEGREES
    if few.any():
        quantile[few] = 2.0 * _gamma_quantile(probability, count[few] / 2.0)
    return quantile.reshape(np.shape(degrees))


def student_tail(t: float, degrees: float) -> float:
    """Probability that Student's t is below -|t|."""
    return 0.5 * _beta_share(0.5 * degrees, 0.5, degrees / (degrees + t * t))


@lru_cache(maxsize=1024)
def student_quantile(probability: float, degrees: float) -> float:
    """Quantile of Student's t, to 1e-8 of it."""
    tail = min(probability, 1.0 - probability)
    size = _root(lambda t: tail - student_tail(t, degrees))
    return math.copysign(size, probability - 0.5)


def f_tail(above: float, below: float, ratio: float) -> float:
    """Probability that F, with `above` and `below` degrees of freedom, is larger than a ratio."""
    return _beta_share(0.5 * below, 0.5 * above, below / (below + above * ratio))


@lru_cache(maxsize=1024)
def range_quantile(probability: float, count: int) -> float:
    """Quantile of the range of so many independent normal numbers of standard deviation 1, to 1e-10.

    Tukey's studentized range with a known standard deviation: the integral over the smallest of the numbers.
    """
    z = np.linspace(-9.0, 9.0, 721)
    density = np.exp(-0.5 * z**2) * count * (z[1] - z[0]) / math.sqrt(2.0 * math.pi)
    below = _normal_share(z)
    return _root(lambda q: float(density @ (_normal_share(z + q) - below) ** (count - 1)) - probability)


def _normal_share(z: Floats) -> Floats:
    return np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in z])


def _root(rising: Callable[[float], float]) -> float:
    """The positive root of a rising function, by bisection to the last digits."""
    low, high = 0.0, 1.0
    while rising(high) < 0.0:
        low, high = high, 2.0 * high
    for _ in range(_MOST_STEPS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if rising(middle) < 0.0 else (low, middle)
    return high


def _gamma_quantile(probability: float, shape: Floats) -> Floats:
    log_factorial = np.array([math.lgamma(a + 1.0) for a in shape])
    log_x = (
        math.log(probability) + log_factorial
    ) / shape  # below the quantile: the series' first term alone
    for _ in range(_MOST_STEPS):
        x = np.exp(log_x)
        term, total, n = np.ones_like(x), np.ones_like(x), 0
        while (term > np.finfo(float).eps * total).any():
            n += 1
            term = term * x / (shape + n)
            total += term
        step = (math.log(probability) - (shape * log_x - x - log_factorial + np.log(total))) * total / shape
        log_x = log_x + step
        if (np.abs(step) < 1e-13).all():
            break
    return np.asarray(np.exp(log_x))


def _beta_share(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function, by its continued fraction (Abramowitz and Stegun 1964, 26.5.8)."""
    if not 0.0 < x < 1.0:
        return x if x in (0.0, 1.0) else math.nan
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - _beta_share(b, a, 1.0 - x)
    front = math.exp(
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    )
    # Lentz's method: numerators and denominators as ratios, which do not overflow.
    c, d = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0))
    fraction = d
    for m in range(1, 100_000):
        for numerator in (
            m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0)),
        ):
            d, c = 1.0 / (1.0 + numerator * d), 1.0 + numerator / c
            fraction *= c * d
        if abs(c * d - 1.0) < 1e-15:
            break
    return front * fraction / a
