"""The movements that fit a window of readings best, for several suppositions at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.live.swaps.moves import Moves
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model

STEPS = 12
ANYWHERE = 0.3
"""Where nothing limits a coordinate, rad or m."""
LIMIT_STD_RAD = 0.15
"""A joint may be beyond its limits by so much: limits are those of most people, and mounts are 5 deg off."""


@dataclass
class Fitting:
    """Fits movements to readings.

    Args:
        model: of the body.
        time_s: (times,) of the readings, s from the window's middle.
        rows: of the model's measurements that there are readings of.
        stds: (rows,) of the errors of real recordings.
    """

    model: Model
    time_s: Floats
    rows: Floats
    stds: Floats

    def __post_init__(self) -> None:
        self.moves = Moves(self.model, self.time_s, self.rows)
        limits = [
            joint.limits if len(joint.coordinates) == 1 else (-np.inf, np.inf)
            for joint in self.model.describe().joints
            for _ in joint.coordinates
        ]
        self._low, self._high = np.array(limits, dtype=float).T

    def fitted(self, seen: Floats, q: Floats, steps: int = STEPS) -> tuple[Floats, Floats]:
        """Costs (suppositions,) and postures (suppositions, coordinates) of the best movements.

        Args:
            seen: (suppositions, times, rows) readings; NaN where there are none.
            q: (suppositions, coordinates) from where to search.
            steps: of the search.
        """
        n = q.shape[1]
        posture, numbers = q.copy(), np.zeros((len(seen), len(self.moves.stds)))
        damping = np.full(len(seen), 1e-2)
        normal, slope, cost = self._normal(seen, posture, numbers)
        for _ in range(steps):
            diagonal = np.einsum("mii->mi", normal)
            step = -np.linalg.solve(
                normal + damping[:, None, None] * (diagonal[:, None, :] * np.eye(len(diagonal[0]))),
                slope[..., None],
            )[..., 0]
            tried_posture = self.moves.moved(posture, np.clip(step[:, :n], -0.7, 0.7))
            tried_numbers = numbers + step
            tried_numbers[:, :n] = 0.0
            tried = self._normal(seen, tried_posture, tried_numbers)
            better = tried[2] < cost
            posture = np.where(better[:, None], tried_posture, posture)
            numbers = np.where(better[:, None], tried_numbers, numbers)
            normal, slope, cost = (
                np.where(better.reshape(-1, *[1] * (new.ndim - 1)), new, old)
                for new, old in zip(tried, (normal, slope, cost), strict=True)
            )
            damping = np.clip(np.where(better, damping / 8.0, damping * 8.0), 1e-6, 1e6)
        return cost, posture

    def scattered(self, number: int) -> Floats:
        """One of many postures between the limits of all joints."""
        low = np.where(np.isfinite(self._low), self._low, self.moves.rest - ANYWHERE)
        high = np.where(np.isfinite(self._high), self._high, self.moves.rest + ANYWHERE)
        share = np.random.default_rng(number + 1).uniform(0.2, 0.8, len(low))
        return np.asarray(low + share * (high - low))

    def _normal(self, seen: Floats, posture: Floats, numbers: Floats) -> tuple[Floats, Floats, Floats]:
        """Normal equations around movements, and the cost."""
        n = posture.shape[1]
        got = self.moves.readings(posture, numbers)
        off = (got.values - seen) / self.stds
        there = np.isfinite(off)
        off = np.where(there, off, 0.0).reshape(len(seen), -1)
        slopes = np.where(there[..., None], got.slopes / self.stds[:, None], 0.0).reshape(*off.shape, -1)
        normal = slopes.transpose(0, 2, 1) @ slopes
        slope = (off[:, None, :] @ slopes)[:, 0]
        cost = (off**2).sum(axis=1)
        away = numbers.copy()
        away[:, :n] = posture - self.moves.rest
        weight = self.moves.stds**-2
        index = np.arange(len(weight))
        normal[:, index, index] += weight
        slope += weight * away
        cost += (weight * away**2).sum(axis=1)
        beyond = np.minimum(posture - self._low, 0.0) + np.maximum(posture - self._high, 0.0)
        normal[:, index[:n], index[:n]] += (beyond != 0.0) / LIMIT_STD_RAD**2
        slope[:, :n] += beyond / LIMIT_STD_RAD**2
        cost += (beyond**2).sum(axis=1) / LIMIT_STD_RAD**2
        return normal, slope, cost
