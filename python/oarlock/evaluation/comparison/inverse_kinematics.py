"""Joint coordinates from link orientations by weighted least squares, for `track_orientations`.

At each instant sum_s |Log(M_s R_s')|^2 / std_s^2 + sum_e (z_e - q_e)^2 / std_e^2 is minimised, with R_s the modelled
orientation of link s, M_s the measured one and z_e the readings of encoders. Source: Levenberg-
Marquardt on the rotation group after J. Sola, J. Deray and D. Atchuthan (2018), "A micro Lie theory for state
estimation in robotics".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.coordinates import plus, rotation_columns
from oarlock.model.rotation import quat_from_matrix, quat_inverse, quat_product, rotvec_from_quat
from oarlock.storage.arrays import Bools, Floats, Indices

if TYPE_CHECKING:
    from oarlock._core import Model


ORIENTATION_STD_RAD = 0.05
"""Usual error of a single unit's filter in motion. It matters only if encoders read the same joint."""
READING_STD = 1e-3

KNOTS_HZ = 20.0
"""Rate of the instants that are solved in sequence, each from the previous one, so that no joint changes its branch."""

ROUNDS = 25
CONVERGED = 1e-6
"""Step length at which the iteration ends, rad or m: the next step would be at least ten times shorter."""
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e3
FOLLOWING_DAMPING = 1e-5
LONGEST_STEP = 0.5
STARTS, PLACES = 12, 9
OUTSIDE = 1e-3
UNSEEN = 1e-3
TURNS = 0.5
"""One radian of a coordinate turns a frame by one radian or, where it is a shift, not at all."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured orientations and readings of a body at T instants.

    Args:
        orientations: frame -> (T, 4) quat_wxyz, root from frame; NaN where missing.
        readings: coordinate of a hinge or slide -> (T,) rad or m; NaN where missing.
        orientation_std_rad: frame -> standard deviation, rad; default `ORIENTATION_STD_RAD`.
        reading_std: coordinate -> standard deviation, rad or m; default `READING_STD`.
    """

    orientations: Mapping[str, Floats]
    readings: Mapping[str, Floats] = field(default_factory=dict)
    orientation_std_rad: Mapping[str, float] = field(default_factory=dict)
    reading_std: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Targets:
    """The same as arrays: (T, S, 4), (T, S), (T, E), (T, E), and the coordinate of each reading (E,)."""

    quats: Floats
    weights: Floats
    values: Floats
    value_weights: Floats
    columns: Indices

    def rows(self, chosen: Indices) -> _Targets:
        quats, weights = self.quats[chosen], self.weights[chosen]
        return _Targets(quats, weights, self.values[chosen], self.value_weights[chosen], self.columns)


def solve(model: Model, measured: Measured, time_s: Floats) -> tuple[Floats, Bools]:
    """Joint coordinates (T, n_coordinates), and whether the measurements determine each, (T, n_coordinates).

    An undetermined coordinate is NaN. Directions that no measurement depends on keep their previous values, so a
    singular pose reduces the accuracy, but the track is not lost.

    Args:
        model: the tree, with hinges, slides, balls and free joints.
        measured: orientations of frames and readings of joints.
        time_s: (T,) s.
    """
    targets = _targets(model, measured)
    problem = _OrientationProblem(model, list(measured.orientations), targets.columns)
    knots = _knots(time_s)
    at, start = problem.start(targets, knots)
    near = np.empty((len(knots), len(model.coordinate_names)))
    for way in (range(at, len(knots)), range(at, -1, -1)):
        posture = start
        for i in way:
            near[i] = posture = problem.follow(posture, targets.rows(knots[i : i + 1]))
    q = near[np.searchsorted(knots, np.arange(len(time_s)), side="right") - 1]
    q = problem.fit(q, targets, ROUNDS)
    seen = problem.seen(q, targets)
    return np.where(seen, q, np.nan), seen


class _OrientationProblem:
    """The least-squares problem of one model and its measured frames."""

    def __init__(self, model: Model, frames: list[str], read: Indices) -> None:
        self._model = model
        self._frames = frames
        self._rows = [model.frame_names.index(name) for name in frames]
        turns = model.frame_jacobian(np.zeros((1, len(model.coordinate_names))), frames).by_coordinate[
            ..., 3:, :
        ]
        # coordinates on which a measurement depends; the others keep their values
        self._measured_columns = np.union1d(
            np.flatnonzero(np.abs(turns).max(axis=(0, 1, 2), initial=0.0) > TURNS), read
        )
        self._read = np.searchsorted(self._measured_columns, read)
        self._turns = rotation_columns(model.coordinate_names)
        self._low, self._high, self._rest = _limits_and_rest(model)

    def start(self, targets: _Targets, knots: Indices) -> tuple[int, Floats]:
        """A knot and its posture (n,): the best fit from several guesses at several knots.

        Three hinges in a row reach every orientation in two ways; the one inside the joints' limits is chosen.
        """
        full = np.count_nonzero(targets.weights[knots], axis=1)
        chances = np.flatnonzero(full == full.max())
        chosen = chances[np.linspace(0, len(chances) - 1, min(PLACES, len(chances))).astype(int)]
        guesses = np.random.default_rng(0).uniform(self._low, self._high, (STARTS, len(self._rest)))
        guesses[0], guesses[1] = self._rest, 0.0
        many = targets.rows(np.repeat(knots[chosen], STARTS))
        found = self.fit(np.tile(guesses, (len(chosen), 1)), many, ROUNDS)
        outside = np.maximum(0.0, self._low - found) + np.maximum(0.0, found - self._high)
        cost = self._normal(found, many)[2] * ORIENTATION_STD_RAD**2
        best = int(np.argmin(cost + OUTSIDE * outside.sum(axis=1)))
        return int(chosen[best // STARTS]), found[best]

    def fit(self, q: Floats, targets: _Targets, rounds: int) -> Floats:
        """Levenberg-Marquardt with a separate damping for each instant."""
        q, going = q.copy(), np.arange(len(q))
        damping = np.full(len(q), LEAST_DAMPING)
        state = self._normal(q, targets)
        for _ in range(rounds):
            information, gradient, cost = (part[going] for part in state)
            step = _damped_step(information, gradient, damping[going])
            tried = self._moved(q[going], step)
            new = self._normal(tried, targets.rows(going))
            better = new[2] <= cost * (1.0 + 1e-12) + 1e-18
            taken = going[better]
            q[taken] = tried[better]
            for old, fresh in zip(state, new, strict=True):
                old[taken] = fresh[better]
            factor = np.where(better, 0.1, 10.0)
            damping[going] = np.maximum(damping[going] * factor, LEAST_DAMPING)
            moving = np.abs(step).max(axis=1, initial=0.0) > CONVERGED
            going = going[moving & (damping[going] < MOST_DAMPING)]
            if not len(going):
                break
        return q

    def follow(self, q: Floats, target: _Targets) -> Floats:
        """One step (n,) to a neighbouring instant, short enough to stay on the branch."""
        information, gradient, _ = self._normal(q[None], target)
        step = _damped_step(information, gradient, np.full(1, FOLLOWING_DAMPING))
        return np.asarray(self._moved(q[None], step)[0])

    def seen(self, q: Floats, targets: _Targets) -> Bools:
        """True where the measurements reduce the variance far below that of a weak prior."""
        information = self._normal(q, targets)[0]
        prior_information = UNSEEN * ORIENTATION_STD_RAD**-2
        variance = np.linalg.inv(information + prior_information * np.eye(len(self._measured_columns)))
        seen = np.zeros(q.shape, dtype=bool)
        seen[:, self._measured_columns] = np.einsum("tii->ti", variance) * prior_information < 0.5
        return seen

    def _normal(self, q: Floats, targets: _Targets) -> tuple[Floats, Floats, Floats]:
        """Information (T, k, k), gradient (T, k) of the k measured coordinates, and cost (T,), at q."""
        rotations = self._model.forward_kinematics(q)[..., :3, :3]
        own = quat_from_matrix(rotations[:, self._rows])
        error = rotvec_from_quat(quat_product(targets.quats, quat_inverse(own)))
        turns = self._model.frame_jacobian(q, self._frames).by_coordinate[..., 3:, self._measured_columns]
        jacobian = turns.reshape(len(q), -1, len(self._measured_columns))
        weights = np.repeat(targets.weights, 3, axis=1)
        weighted = np.swapaxes(jacobian * weights[:, :, None], 1, 2)
        flat = error.reshape(len(q), -1)
        information = weighted @ jacobian
        gradient = (weighted @ flat[:, :, None])[:, :, 0]
        off = targets.values - q[:, targets.columns]
        information[:, self._read, self._read] += targets.value_weights
        gradient[:, self._read] += targets.value_weights * off
        cost = np.sum(weights * flat**2, axis=1) + np.sum(targets.value_weights * off**2, axis=1)
        return information, gradient, cost

    def _moved(self, q: Floats, step: Floats) -> Floats:
        whole = np.zeros_like(q)
        whole[:, self._measured_columns] = step
        return plus(q, whole, self._turns)


def _damped_step(information: Floats, gradient: Floats, damping: Floats) -> Floats:
    n = information.shape[1]
    size = damping * (np.einsum("tii->t", information) + 1.0)
    step = np.linalg.solve(information + size[:, None, None] * np.eye(n), gradient[:, :, None])[:, :, 0]
    longest = np.abs(step).max(axis=1, initial=0.0, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP)))


def _targets(model: Model, measured: Measured) -> _Targets:
    frames, names = list(measured.orientations), list(measured.readings)
    count = len(next(iter([*measured.orientations.values(), *measured.readings.values()])))
    quats = (
        np.stack([measured.orientations[f] for f in frames], axis=1) if frames else np.empty((count, 0, 4))
    )
    there = np.asarray(np.isfinite(quats).all(axis=2))
    std = np.array([measured.orientation_std_rad.get(f, ORIENTATION_STD_RAD) for f in frames])
    values = np.stack([measured.readings[n] for n in names], axis=1) if names else np.empty((count, 0))
    read = np.isfinite(values)
    value_std = np.array([measured.reading_std.get(n, READING_STD) for n in names])
    return _Targets(
        np.where(there[:, :, None], quats, [1.0, 0.0, 0.0, 0.0]),
        there / std**2,
        np.where(read, values, 0.0),
        read / value_std**2,
        np.array([model.coordinate_names.index(n) for n in names], dtype=np.intp),
    )


def _limits_and_rest(model: Model) -> tuple[Floats, Floats, Floats]:
    """Soft limits and rest of each coordinate; without limits half a turn in both directions."""
    names = list(model.coordinate_names)
    low, high, rest = (np.full(len(names), x) for x in (-np.pi, np.pi, 0.0))
    for joint in model.describe().joints:
        if len(joint.coordinates) == 1:
            k = names.index(joint.coordinates[0])
            low[k], high[k] = joint.limits
            rest[k] = joint.rest
    return low, high, rest


def _knots(time_s: Floats) -> Indices:
    """Indices about 1 / `KNOTS_HZ` apart, including the first one."""
    slots = np.floor((time_s - time_s[0]) * KNOTS_HZ)
    return np.flatnonzero(np.concatenate([[True], np.diff(slots) > 0]))
