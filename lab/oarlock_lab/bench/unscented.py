"""The scaled unscented filter (Wan and van der Merwe 2000) of others: in arrays of NumPy or JAX, and in filterpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import linalg

from oarlock.model.description import ModelDescription
from oarlock.storage.arrays import Floats
from oarlock_lab.bench.plain_kinematics import Array, PlainKinematics
from oarlock_lab.bench.problem import RATE_HZ, WARM, BenchProblem


class SigmaFilter:
    """The matrices of one problem, and one filter step.

    Args:
        problem: the readings; the states are those of the plain configuration.
        states: their names.
        xp: `numpy` or `jax.numpy`.
        cho_solve: SciPy's, or that of `jax.scipy.linalg`.
    """

    def __init__(
        self, problem: BenchProblem, states: list[str], xp: Any = np, cho_solve: Any = linalg.cho_solve
    ) -> None:
        self.xp, self.n, self._solve = xp, len(states), cho_solve
        self.kinematics = PlainKinematics(problem.described, states, xp)
        config = problem.config(plain=True)
        self.alpha, self.beta, self.kappa = config.alpha, config.beta, config.kappa
        self.reach = self.alpha**2 * (self.n + self.kappa)
        around = np.full(2 * self.n, 0.5 / self.reach)
        mean_0 = 1.0 - self.n / self.reach
        self.mean_weights = xp.asarray([mean_0, *around])
        self.weights = xp.asarray([mean_0 + 1.0 - self.alpha**2 + self.beta, *around])
        transition, drive = transition_and_drive(problem.described, states, 1.0 / RATE_HZ)
        self.transition, self.drive = xp.asarray(transition), xp.asarray(drive)
        self.noise = xp.asarray(np.diag(row_std(problem.described) ** 2))
        off = np.zeros((len(problem.read_inputs), problem.inputs.shape[1]))
        for row, column in enumerate(problem.read_inputs):
            off[row, column] = problem.described.joints[column].std
        self._off = xp.asarray(np.vstack([np.zeros((2 * self.n + 1, off.shape[1])), off]))

    def step(self, mean: Array, covariance: Array, z: Array, inputs: Array) -> tuple[Array, Array]:
        """Predicts over one sample and updates with readings z (m,) and inputs (n_coordinates,)."""
        xp, n = self.xp, self.n
        mean = self.transition @ mean
        covariance = self.transition @ covariance @ self.transition.T + self.drive
        spread = xp.linalg.cholesky(covariance).T * xp.sqrt(self.reach)
        away = xp.concatenate([xp.zeros((1, n)), spread, -spread])
        # after the sigma points: the mean with each input changed by its standard deviation
        count = self._off.shape[0] - len(away)
        points = mean + xp.concatenate([away, xp.zeros((count, n))])
        read = self.kinematics.measure(points, inputs + self._off)
        changes = read[len(away) :] - read[0]
        read = read[: len(away)]
        expected = self.mean_weights @ read
        gaps = read - expected
        weighted = self.weights[:, None] * gaps
        inner = weighted.T @ gaps + changes.T @ changes + self.noise
        gain = self._solve((xp.linalg.cholesky(inner), True), weighted.T @ away).T
        covariance = covariance - gain @ inner @ gain.T
        return mean + gain @ (z - expected), 0.5 * (covariance + covariance.T)

    def input_noise(self, mean: Floats, inputs: Floats) -> Floats:
        """Covariance of the readings due to noisy inputs, (m, m)."""
        off = np.asarray(self._off)[2 * self.n :]
        read = self.kinematics.measure(np.tile(mean, (len(off), 1)), inputs + off)
        changes = read[1:] - read[0]
        return np.asarray(changes.T @ changes)


def transition_and_drive(described: ModelDescription, states: list[str], dt: float) -> tuple[Floats, Floats]:
    """Linear motion over `dt` seconds and its noise, (n, n) each: white jerk, or walks."""
    place = {name: k for k, name in enumerate(states)}
    transition, drive = np.eye(len(states)), np.zeros((len(states), len(states)))
    jerk = np.array(
        [
            [dt**4 / 20, dt**3 / 8, dt**2 / 6],
            [dt**3 / 8, dt**2 / 3, dt / 2],
            [dt**2 / 6, dt / 2, 1.0],
        ]
    )
    for joint in described.joints:
        if joint.name not in place or joint.process is None:
            continue
        power = joint.process.density**2 * dt
        if joint.process.kind == "walk":
            drive[place[joint.name], place[joint.name]] = power
            continue
        at = [place[joint.name + rate] for rate in ("", ".velocity", ".acceleration")]
        transition[at[0], at[1]] = transition[at[1], at[2]] = dt
        transition[at[0], at[2]] = dt**2 / 2
        drive[np.ix_(at, at)] = power * jerk
    if "azimuth" in place:
        drive[place["azimuth"], place["azimuth"]] = described.world.azimuth_walk**2 * dt
    return transition, drive


def row_std(described: ModelDescription) -> Floats:
    """Standard deviation of every row, (m,), in the order of `measurement_names`."""
    stds: dict[str, float] = {}
    for unit in described.inertial_units:
        parts = {"gyro": unit.gyro_std_rad_s, "accel": unit.accel_std_m_s2, "mag": unit.mag_std_ut}
        stds |= {f"{unit.name}.{part}_{a}": std for part, std in parts.items() if std for a in "xyz"}
    stds |= {encoder.name: encoder.std for encoder in described.encoders}
    for closure in described.closures:
        stds |= {f"{closure.name}.{a}": closure.std_m for a in "xyz"}
        stds |= {f"{closure.name}.axis_{a}": closure.std_axis for a in "xyz"}
    return np.array([stds[name] for name in described.measurement_names])


_NUMPY_STEPS = 100


def numpy_run(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over `_NUMPY_STEPS` samples: means, (steps, n)."""
    tracker, mean, covariance = problem.started()
    filter_ = SigmaFilter(problem, tracker.state_names)
    span = slice(WARM, WARM + _NUMPY_STEPS)

    def run() -> Floats:
        x, p, means = mean, covariance, []
        for z, inputs in zip(problem.readings[span], problem.inputs[span], strict=True):
            x, p = filter_.step(x, p, z, inputs)
            means.append(x)
        return np.array(means)

    return run


def jax_run(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over all samples after the warm-up: means, (steps, n). The first call compiles."""
    import jax
    from jax import lax
    from jax import numpy as jnp
    from jax.scipy.linalg import cho_solve

    # JAX uses single precision unless this is set before its first array
    jax.config.update("jax_enable_x64", True)
    tracker, mean, covariance = problem.started()
    filter_ = SigmaFilter(problem, tracker.state_names, jnp, cho_solve)

    def step(belief: Any, data: Any) -> Any:
        belief = filter_.step(*belief, *data)
        return belief, belief[0]

    scan = jax.jit(lambda belief, data: lax.scan(step, belief, data)[1])
    belief = (jnp.asarray(mean), jnp.asarray(covariance))
    data = (jnp.asarray(problem.readings[WARM:]), jnp.asarray(problem.inputs[WARM:]))
    return lambda: np.asarray(scan(belief, data))


_FILTERPY_STEPS = 4


def filterpy_run(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over `_FILTERPY_STEPS` samples: means, (steps, n)."""
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
        for k in range(WARM, WARM + _FILTERPY_STEPS):
            theirs.predict()
            inputs = problem.inputs[k]
            noise = ours.noise + ours.input_noise(theirs.x, inputs)
            theirs.update(problem.readings[k], R=noise, inputs=inputs)
            means.append(theirs.x.copy())
        return np.array(means)

    return run
