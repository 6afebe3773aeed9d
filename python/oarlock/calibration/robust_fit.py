"""Robust least squares by iteratively reweighted Gauss-Newton steps on exact Jacobians, for all searches of this room.

SciPy's `least_squares` serves neither rotations nor directions that no residual determines: it has neither a retraction
nor a minimum-norm step.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oarlock.storage.arrays import Floats

TURNS = 30
ROUNDING = 1e-12
HALVINGS = 8

Linearised = Callable[[Floats], tuple[Floats, Floats]]
Loss = Callable[[Floats], tuple[float, Floats]]


def robust_fit(
    linearised: Linearised,
    start: Floats,
    loss: Loss,
    *,
    moved: Callable[[Floats, Floats], Floats] = np.add,
    damping: float = 0.0,
    converged: float = 1e-8,
) -> tuple[Floats, Floats]:
    """The estimate and the covariance (n, n) of its steps.

    Args:
        linearised: estimate -> (m,) residuals and their (m, n) Jacobian by a step, in standard deviations.
        start: the first estimate.
        loss: (m,) residuals -> cost and (m,) weights, such as `huber`.
        moved: an estimate and a step (n,) -> the next estimate.
        damping: information of each unknown that pulls towards no value. It holds undetermined directions.
        converged: the search ends when all entries of a step are smaller.
    """
    estimate = start
    residuals, slopes = linearised(start)
    cost, weights = loss(residuals)
    for _ in range(TURNS):
        information = _information(slopes, weights, damping)
        step = -np.linalg.solve(information, slopes.T @ (weights * residuals))
        # A full step diverges where the data hardly determine a direction.
        for halving in range(HALVINGS):
            tried = moved(estimate, np.asarray(step * float(0.5**halving), dtype=np.float64))
            residuals, slopes = linearised(tried)
            tried_cost, weights = loss(residuals)
            if tried_cost <= cost * (1.0 + ROUNDING):
                break
        estimate, cost = tried, tried_cost
        if np.abs(step).max() < converged:
            break
    return estimate, np.asarray(np.linalg.inv(_information(slopes, weights, damping)), dtype=np.float64)


def _information(slopes: Floats, weights: Floats, damping: float) -> Floats:
    return np.asarray((slopes * weights[:, None]).T @ slopes + damping * np.eye(slopes.shape[1]))


def huber(threshold: float, rows: int = 1) -> Loss:
    """The loss of Huber (1964); the norm of each `rows` consecutive residuals counts as one residual."""

    def loss(residuals: Floats) -> tuple[float, Floats]:
        size = np.linalg.norm(residuals.reshape(-1, rows), axis=1)
        inner = np.minimum(size, threshold)
        cost = float((inner * (size - 0.5 * inner)).sum())
        return cost, np.repeat(np.minimum(1.0, threshold / np.maximum(size, 1e-12)), rows)

    return loss
