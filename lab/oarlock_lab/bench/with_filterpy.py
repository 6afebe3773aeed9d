"""Times filterpy's `UnscentedKalmanFilter` with a measurement function in Python, one sigma point at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oarlock_lab.bench.problem import RATE_HZ, WARM, BenchProblem, Floats
from oarlock_lab.bench.sigma_filter import SigmaFilter

STEPS = 4


def make(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over `STEPS` samples: means, (steps, n)."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    tracker, mean, covariance = problem.started()
    ours = SigmaFilter(problem, tracker.state_names)

    def read(x: Floats, inputs: Floats) -> Floats:
        return np.asarray(ours.kinematics.measure(x[None], inputs)[0])

    def run() -> Floats:
        points = MerweScaledSigmaPoints(ours.n, ours.alpha, ours.beta, ours.kappa)
        theirs = UnscentedKalmanFilter(
            dim_x=ours.n,
            dim_z=len(ours.noise),
            dt=1.0 / RATE_HZ,
            hx=read,
            fx=lambda x, dt: ours.transition @ x,
            points=points,
        )
        theirs.x, theirs.P, theirs.Q = mean.copy(), covariance.copy(), ours.drive
        means = []
        for k in range(WARM, WARM + STEPS):
            theirs.predict()
            inputs = problem.inputs[k]
            noise = ours.noise + ours.input_noise(theirs.x, inputs)
            theirs.update(problem.readings[k], R=noise, inputs=inputs)
            means.append(theirs.x.copy())
        return np.array(means)

    return run
