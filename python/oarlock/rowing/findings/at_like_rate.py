"""Changes between groups of strokes at like stroke rate: a robust regression that removes what the rate does.

    number = a + b r + c r^2 + d x + noise,   r: stroke rate minus its median, x: 1 in the later group, else 0

b and c have normal priors about 0, so that a small change of rate does not make d uncertain, and a ramp, which the
rate explains as well as the time does, leaves d uncertain. Outliers get Huber's weights (1964). Neighbouring strokes
are alike, so their variance is widened by (1 + q) / (1 - q), q the correlation of neighbours. The scatter itself is
as well known as from (1 - q^2) / (1 + q^2) as many independent strokes (Bayley and Hammersley 1946).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.statistics import robust_std

_HUBER = 1.5
_ROUNDS = 8
_MOST_ALIKE = 0.8
_USUAL_ALIKE = 0.4
"""Correlation of neighbours where 20 strokes or fewer do not show it well; it is mixed in as if from 10 strokes."""
_MIXED_STROKES = 10.0
_NO_SCATTER = 1e-12
_LEAST_PRECISION = 1e-12
FITTED = 4
"""Coefficients of the regression."""
_BEND_OF_SLOPE = 0.08
"""Prior of c, relative to that of b, per stroke per minute."""


@dataclass(frozen=True, eq=False)
class RateAdjustedChange:
    """Later group minus earlier one at like rate.

    Attributes:
        size: d.
        scatter_sd: its standard deviation from the scatter of strokes.
        freedom: degrees of freedom of that.
        rate_sd: its standard deviation from the doubt about the rate's effect.
        residuals: of all strokes, (N,).
    """

    size: float
    scatter_sd: float
    freedom: float
    rate_sd: float
    residuals: Floats


def change(values: Floats, rate: Floats, later: Bools, slope_sd: float) -> RateAdjustedChange:
    """Change from the strokes that are not `later` to those that are, (N,) each.

    `slope_sd` is the prior standard deviation of b, in the unit of the values per 1/min.
    """
    r = rate - np.median(rate)
    columns = np.stack([np.ones_like(r), r, r**2, later.astype(np.float64)], axis=1)
    prior = np.zeros(FITTED)
    prior[1:3] = slope_sd, slope_sd * _BEND_OF_SLOPE
    weights = np.ones(len(values))
    scatter = max(float(np.std(values)), _NO_SCATTER)
    for _ in range(_ROUNDS):
        precision = np.zeros_like(prior)
        precision[prior > 0.0] = scatter**2 / prior[prior > 0.0] ** 2
        squares = columns.T @ (weights[:, None] * columns)
        # Where all strokes have one rate, its slope and bend are not determined.
        precision = np.where(
            prior > 0.0, np.maximum(precision, _LEAST_PRECISION * np.diag(squares).max()), 0.0
        )
        normal = squares + np.diag(precision)
        found = np.linalg.solve(normal, columns.T @ (weights * values))
        residuals = values - columns @ found
        scatter = robust_sd(residuals, FITTED)
        weights = np.minimum(1.0, _HUBER * scatter / np.maximum(np.abs(residuals), 1e-300))
    of_values, of_prior = _variances(normal, precision, scatter)
    alike = _alike(residuals, scatter)
    widened = (1.0 + alike) / (1.0 - alike)
    freedom = max(len(values) * (1.0 - alike**2) / (1.0 + alike**2) - 2.0, 2.0)
    return RateAdjustedChange(
        float(found[-1]),
        max(float(np.sqrt(of_values * widened)), _NO_SCATTER),
        freedom,
        float(np.sqrt(of_prior)),
        residuals,
    )


def _variances(normal: Floats, precision: Floats, scatter: float) -> tuple[float, float]:
    """Variance of the last coefficient from the values and from the priors."""
    last = np.linalg.inv(normal)[-1]
    of_prior = float(last @ (precision * last))
    return scatter**2 * max(float(last[-1]) - of_prior, 0.0), scatter**2 * of_prior


def robust_sd(residuals: Floats, fitted: int) -> float:
    """Scatter of residuals (N,) of a fit of so many coefficients, from the median of their absolute values.

    Not below two thirds of the ordinary one.
    """
    count = len(residuals)
    widened = np.sqrt(count / max(count - fitted, 1))
    robust = robust_std(residuals)
    return max(robust, 0.67 * float(np.sqrt(np.mean(residuals**2))), _NO_SCATTER) * float(widened)


def _alike(residuals: Floats, scatter: float) -> float:
    bounded = np.clip(residuals, -2.0 * scatter, 2.0 * scatter)
    own = float(bounded[1:] @ bounded[:-1]) / max(float(bounded @ bounded), 1e-300)
    count = len(residuals)
    mixed = (count * max(own, 0.0) + _MIXED_STROKES * _USUAL_ALIKE) / (count + _MIXED_STROKES)
    return min(mixed, _MOST_ALIKE)
