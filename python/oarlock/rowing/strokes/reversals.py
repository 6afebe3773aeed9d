"""Fits times and values of reversals between samples, with standard deviations, for the stroke finders.

A polynomial of fourth degree is fitted to what was read around the turn, over as much of it as the movement is still
near (a share of the least movement that counts), and its extreme is the reversal. A low-pass before the search would
move reversals whose two sides differ, as at the catch, by some milliseconds; this does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import robust_std

_DEGREE = 4
_FIRST_HALF_WINDOW_S = 0.12
_HALF_WINDOW_S = (0.06, 0.20)
_ROUNDS = 3
_OUTLIER = 5.0
_SHAPE_STD_S = 5e-4
"""What the polynomial's shape costs: strokes of 16 to 44 a minute without noise were off by 0.1 to 0.6 ms."""
_EDGE_S = 0.06
_EDGE_STD_S = 0.02
_FURTHEST = 0.7
"""Of the half window: a root further out is extrapolated."""


@dataclass(frozen=True)
class Reversal:
    """A reversal of a movement.

    Attributes:
        high: from rising to falling; else from falling to rising.
        time_s: when, s.
        time_std_s: its standard deviation.
        value: of the signal at the turn, in its unit.
        value_std: of noise alone.
        curvature: second derivative at the turn, per s2; NaN where the signal stood still there.
    """

    high: bool
    time_s: float
    time_std_s: float
    value: float
    value_std: float
    curvature: float


def fit_reversal(time_s: Floats, value: Floats, around_s: float, high: bool, reach: float) -> Reversal | None:
    """The reversal nearest to a time; None where there is none, or too few readings.

    Args:
        time_s: (K,) stamps, s.
        value: (K,) readings.
        around_s: where the extreme reading was.
        high: whether it is a maximum.
        reach: how far from its extreme the signal is still used, in its unit.
    """
    half_s = _half_window(time_s, value, around_s, reach)
    centre = around_s
    fit = None
    for _ in range(_ROUNDS):
        fit = _PolynomialFit.of(time_s, value, centre, half_s)
        root = None if fit is None else fit.root(high)
        if fit is None or root is None:
            return None
        centre += root * half_s
        if abs(centre - around_s) > 2.0 * _HALF_WINDOW_S[1]:
            return None
        if abs(root) * half_s < 1e-4:
            break
    assert fit is not None
    return fit.reversal(centre, high)


def edge_reversal(time_s: Floats, value: Floats, high: bool, reach: float) -> Reversal | None:
    """The reversal at the very first reading, from the parabola behind it; None if the movement was under way."""
    half_s = _half_window(time_s, value, time_s[0] + _FIRST_HALF_WINDOW_S, reach)
    rows = time_s - time_s[0] <= half_s
    if rows.sum() < 5:
        return None
    c, b, a = np.polynomial.polynomial.polyfit(time_s[rows] - time_s[0], value[rows], 2)
    at = -b / (2.0 * a) if a != 0.0 else np.inf
    if (a < 0.0) != high or abs(at) > _EDGE_S:
        return None
    return Reversal(
        high, float(time_s[0] + at), _EDGE_STD_S, float(c), abs(float(a)) * _EDGE_S**2, 2.0 * float(a)
    )


def needed_until(time_s: Floats, value: Floats, around_s: float, reach: float) -> float:
    """Time up to which `fit_reversal` needs readings to have both sides, s."""
    return around_s + _half_window(time_s, value, around_s, reach)


def _half_window(time_s: Floats, value: Floats, around_s: float, reach: float) -> float:
    near = np.abs(time_s - around_s) <= _FIRST_HALF_WINDOW_S
    if near.sum() < 4:
        return _HALF_WINDOW_S[1]
    bend = 2.0 * abs(np.polynomial.polynomial.polyfit(time_s[near] - around_s, value[near], 2)[2])
    return float(np.clip(np.sqrt(2.0 * reach / max(bend, 1e-9)), *_HALF_WINDOW_S))


@dataclass(frozen=True)
class _PolynomialFit:
    """A polynomial in (t - centre) / half window, with what its coefficients are uncertain by."""

    centre_s: float
    half_s: float
    coefficients: Floats
    covariance: Floats
    first: float
    last: float

    @staticmethod
    def of(time_s: Floats, value: Floats, centre_s: float, half_s: float) -> _PolynomialFit | None:
        rows = np.abs(time_s - centre_s) <= half_s
        u, y = (time_s[rows] - centre_s) / half_s, value[rows]
        if len(u) <= _DEGREE + 2:
            return None
        powers = np.vander(u, _DEGREE + 1, increasing=True)
        kept = np.ones(len(u), dtype=bool)
        for _ in range(2):
            solution = np.linalg.lstsq(powers[kept], y[kept], rcond=None)[0]
            left = y - powers @ solution
            spread = robust_std(left[kept])
            kept = np.abs(left) <= max(_OUTLIER * spread, 1e-12)
            if kept.all():
                break
            if kept.sum() <= _DEGREE + 2:
                return None
        variance = float(np.sum(left[kept] ** 2)) / (int(kept.sum()) - _DEGREE - 1)
        information = powers[kept].T @ powers[kept]
        covariance = np.asarray(variance * np.linalg.pinv(information), dtype=np.float64)
        coefficients = np.asarray(solution, dtype=np.float64)
        return _PolynomialFit(centre_s, half_s, coefficients, covariance, float(u[0]), float(u[-1]))

    def slope(self, order: int, u: float) -> float:
        return float(
            np.polynomial.polynomial.polyval(u, np.polynomial.polynomial.polyder(self.coefficients, order))
        )

    def root(self, high: bool) -> float | None:
        """Nearest extreme of the right kind, in half windows from the centre."""
        roots = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(self.coefficients))
        real = [float(r.real) for r in roots if abs(r.imag) < 1e-9]
        inside = (max(-_FURTHEST, self.first - 0.1), min(_FURTHEST, self.last + 0.1))
        real = [r for r in real if inside[0] <= r <= inside[1] and (self.slope(2, r) < 0.0) == high]
        return min(real, key=abs) if real else None

    def reversal(self, time_s: float, high: bool) -> Reversal:
        u = (time_s - self.centre_s) / self.half_s
        bend = self.slope(2, u)
        order = np.arange(_DEGREE + 1)
        at = u**order
        slope = order * np.where(order > 0, u ** np.maximum(order - 1, 0), 0.0)
        time_std = self.half_s * np.sqrt(slope @ self.covariance @ slope) / abs(bend)
        return Reversal(
            high,
            time_s,
            float(np.hypot(time_std, _SHAPE_STD_S)),
            float(at @ self.coefficients),
            float(np.sqrt(at @ self.covariance @ at)),
            bend / self.half_s**2,
        )
