"""Times the unscented filter in NumPy, with kinematics vectorised over sigma points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oarlock_lab.bench.problem import WARM, BenchProblem, Floats
from oarlock_lab.bench.sigma_filter import SigmaFilter

STEPS = 100


def make(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over `STEPS` samples: means, (steps, n)."""
    tracker, mean, covariance = problem.started()
    filter_ = SigmaFilter(problem, tracker.state_names)
    span = slice(WARM, WARM + STEPS)

    def run() -> Floats:
        x, p, means = mean, covariance, []
        for z, inputs in zip(problem.readings[span], problem.inputs[span], strict=True):
            x, p = filter_.step(x, p, z, inputs)
            means.append(x)
        return np.array(means)

    return run
