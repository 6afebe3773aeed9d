"""Damped least squares for many postures at a time, for inverse kinematics and body fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.storage.arrays import Bools, Floats

_MOST_ROUNDS: Final = 60
_SETTLED: Final = 1e-12
"""Smallest step of an iteration in standard deviations of the prior; smaller ones are rounding errors."""
_LOOSE: Final = 1e-5
_DETERMINED: Final = 25.0
"""Smallest information of a determined direction relative to its prior: a standard deviation five times smaller."""


@dataclass(frozen=True, eq=False)
class MarkerObservation:
    """Visible markers in some frames.

    Args:
        place_m: (T, n, 3) positions, arbitrary where not visible.
        weight: (T, n) reciprocal of the standard deviation in m; 0 where not visible.
    """

    place_m: Floats
    weight: Floats

    def rows(self, kept: Any) -> MarkerObservation:
        """Some of the frames."""
        return MarkerObservation(self.place_m[kept], self.weight[kept])


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of a posture: mean (T, c) and standard deviation (c,)."""

    mean: Floats
    std: Floats


@dataclass(frozen=True, eq=False)
class PostureSolution:
    """Postures.

    Args:
        q: (T, c).
        std: (T, c) standard deviations of small steps, from the normal equations with data and prior.
        determined: (T, c) whether the data determine the coordinate; otherwise it follows from the prior.
        settled: (T,) whether the iteration converged.
        cost: (T,) sum of the squared residuals in standard deviations.
    """

    q: Floats
    std: Floats
    determined: Bools
    settled: Bools
    cost: Floats


def found_postures(tree: PointTree, sight: MarkerObservation, prior: Prior, start: Floats) -> PostureSolution:
    """The postures that fit the markers best; undetermined directions stay nearest to the prior.

    Levenberg-Marquardt with the prior comes first and always converges. Gauss-Newton without the prior follows, in the
    determined directions only. So the prior causes no bias in them, and exact data give exact postures.
    """
    q = with_prior(tree, sight, prior, start, _LOOSE)
    q, settled = _without_prior(tree, sight, prior, q)
    residual, size, shapes = _directions(tree, sight, prior, q)
    determined = size > _DETERMINED
    variance = np.einsum("tck,tk->tc", shapes**2, 1.0 / (np.maximum(size, 0.0) + 1.0))
    undetermined_share = np.einsum("tck,tk->tc", shapes**2, 1.0 - determined)
    return PostureSolution(
        q, prior.std * np.sqrt(variance), undetermined_share < 0.01, settled, _square(residual)
    )


def with_prior(
    tree: PointTree, sight: MarkerObservation, prior: Prior, start: Floats, tolerance: float = _LOOSE
) -> Floats:
    """Postures (T, c) that minimise the squares of residuals and of deviations from the prior."""
    q, damping = np.array(start), np.full(len(start), 1e-3)
    cost = _cost(tree, sight, prior, q)
    active = np.ones(len(q), dtype=bool)
    for _ in range(_MOST_ROUNDS):
        rows = np.flatnonzero(active)
        if not rows.size:
            break
        near, here = sight.rows(rows), Prior(prior.mean[rows], prior.std)
        residual, slopes = _linear(tree, near, here, q[rows])
        away = tree.minus(q[rows], here.mean) / here.std
        normal = np.einsum("trc,trd->tcd", slopes, slopes) + np.eye(q.shape[1])
        pull = np.einsum("trc,tr->tc", slopes, residual) - away
        diagonal = np.einsum("tcc->tc", normal)
        damped = normal + (damping[rows, None] * diagonal)[:, :, None] * np.eye(q.shape[1])
        step = np.linalg.solve(damped, pull[..., None])[..., 0]
        tried = tree.plus(q[rows], step * here.std)
        new_cost = _cost(tree, near, here, tried)
        better = new_cost <= cost[rows]
        q[rows[better]] = tried[better]
        gain = cost[rows] - new_cost
        cost[rows[better]] = new_cost[better]
        damping[rows] = np.clip(np.where(better, damping[rows] * 0.1, damping[rows] * 10.0), 1e-12, 1e12)
        small = (np.abs(step).max(axis=1) < tolerance) | (better & (gain <= 1e-9 * new_cost))
        active[rows[small | (damping[rows] >= 1e12)]] = False
    return q


def _without_prior(
    tree: PointTree, sight: MarkerObservation, prior: Prior, start: Floats
) -> tuple[Floats, Bools]:
    """Gauss-Newton in the determined directions. A step that makes the fit worse is halved; if that fails it ends."""
    q = np.array(start)
    active = np.ones(len(q), dtype=bool)
    settled = np.zeros(len(q), dtype=bool)
    for _ in range(_MOST_ROUNDS):
        rows = np.flatnonzero(active)
        if not rows.size:
            break
        near, here = sight.rows(rows), Prior(prior.mean[rows], prior.std)
        residual, slopes = _linear(tree, near, here, q[rows])
        size, shapes = np.linalg.eigh(np.einsum("trc,trd->tcd", slopes, slopes))
        pull = np.einsum("trc,tr->tc", slopes, residual)
        along = np.einsum("tck,tc->tk", shapes, pull) * (size > _DETERMINED) / np.maximum(size, _DETERMINED)
        step = np.einsum("tck,tk->tc", shapes, along)
        before = _square(residual)
        better, tried = _halved(tree, near, here, q[rows], step, before)
        q[rows[better]] = tried[better]
        small = np.abs(step).max(axis=1) < _SETTLED
        # no step improves the fit any more: only rounding errors remain
        stuck = ~better
        settled[rows[small | (stuck & (np.abs(step).max(axis=1) < _LOOSE))]] = True
        active[rows[small | stuck]] = False
    return q, settled


def _halved(
    tree: PointTree,
    sight: MarkerObservation,
    prior: Prior,
    q: Floats,
    step: Floats,
    before: Floats,
) -> tuple[Bools, Floats]:
    tried, better = np.array(q), np.zeros(len(q), dtype=bool)
    for share in (1.0, 0.5, 0.25, 0.125):
        rows = np.flatnonzero(~better)
        if not rows.size:
            break
        candidate = tree.plus(q[rows], share * step[rows] * prior.std)
        residual = _residual(tree, sight.rows(rows), candidate)
        good = _square(residual) < before[rows]
        tried[rows[good]] = candidate[good]
        better[rows[good]] = True
    return better, tried


def _directions(
    tree: PointTree, sight: MarkerObservation, prior: Prior, q: Floats
) -> tuple[Floats, Floats, Floats]:
    residual, slopes = _linear(tree, sight, prior, q)
    size, shapes = np.linalg.eigh(np.einsum("trc,trd->tcd", slopes, slopes))
    return residual, size, shapes


def _linear(tree: PointTree, sight: MarkerObservation, prior: Prior, q: Floats) -> tuple[Floats, Floats]:
    """Residuals (T, 3 n) in standard deviations, and derivatives (T, 3 n, c) by steps in those of the prior."""
    places, slopes = tree.with_slopes(q)
    weight = sight.weight[..., None]
    residual = np.where(weight > 0.0, sight.place_m - places, 0.0) * weight
    scaled = slopes * weight[..., None] * prior.std
    return residual.reshape(len(q), -1), scaled.reshape(len(q), -1, q.shape[1])


def _residual(tree: PointTree, sight: MarkerObservation, q: Floats) -> Floats:
    weight = sight.weight[..., None]
    residual = np.where(weight > 0.0, sight.place_m - tree.at(q), 0.0) * weight
    return np.asarray(residual.reshape(len(q), -1))


def _cost(tree: PointTree, sight: MarkerObservation, prior: Prior, q: Floats) -> Floats:
    away = tree.minus(q, prior.mean) / prior.std
    return _square(_residual(tree, sight, q)) + _square(away)


def _square(rows: Floats) -> Floats:
    return np.asarray(np.einsum("tr,tr->t", rows, rows))
