"""Robust Gauss-Newton least squares with Huber's weights (1964) against outliers, for the session's sensor searches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oarlock.storage.array_gate import FloatArray

TURNS = 30
STEP = 1e-6
SETTLED = 1e-8


def robust_fit(
    misses: Callable[[FloatArray], FloatArray], start: FloatArray, huber: float = 3.0
) -> tuple[FloatArray, FloatArray]:
    """Parameters (n,) and their covariance (n, n).

    Args:
        misses: parameters (n,) -> (m,) residuals in standard deviations.
        start: (n,) where to begin, all of a size for which a step of 1e-6 is small and above rounding.
        huber: beyond so many standard deviations a residual counts less.
    """
    p, information = start.copy(), np.eye(len(start))
    for _ in range(TURNS):
        here = misses(p)
        slopes = np.stack(
            [(misses(p + s) - misses(p - s)) / (2.0 * STEP) for s in STEP * np.eye(len(p))], axis=1
        )
        weights = np.minimum(1.0, huber / np.maximum(np.abs(here), 1e-12))
        information = (slopes * weights[:, None]).T @ slopes
        step = -np.linalg.solve(information, slopes.T @ (weights * here))
        p = p + step
        if np.abs(step).max() < SETTLED:
            break
    return p, np.asarray(np.linalg.inv(information), dtype=np.float64)
