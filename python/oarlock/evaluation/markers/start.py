"""Start values of inverse kinematics: many starts for one frame, then the solution of the previous frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from oarlock.evaluation.markers.least_squares import MarkerObservation, Prior, with_prior
from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.model.rotation import continuous_quat, quat_from_rotvec, rotvec_from_quat
from oarlock.storage.arrays import Floats
from oarlock.storage.progress import Told

if TYPE_CHECKING:
    from oarlock._core import Model

ANCHOR_S: Final = 0.1
"""Time between two frames that are solved one after the other, s: limbs rotate by less than a right angle meanwhile."""
_TRIES: Final = 48
_PLACE_STD_M: Final = 10.0
"""Standard deviation of the position of a free joint in a laboratory, m."""


def body_prior(model: Model) -> tuple[Floats, Floats]:
    """Mean and standard deviation (c,) of a posture: soft limits lie two standard deviations from their middle."""
    mean, std = [], []
    for joint in model.describe().joints:
        width = len(joint.coordinates)
        if not width:
            continue
        low, high = joint.limits
        if width == 1:
            mean.append(0.5 * (low + high))
            std.append(0.25 * (high - low))
            continue
        about = joint.cone.limits_about() if joint.cone else (joint.limits,) * 3
        mean += np.ravel(joint.rest).tolist()
        std += [_PLACE_STD_M] * (width - 3) + [0.25 * (high - low) for low, high in about]
    return np.array(mean), np.array(std)


def first_posture(tree: PointTree, sight: MarkerObservation, prior: Prior, given: Floats | None) -> Floats:
    """The best of many fits of one frame, (1, c): one starts at the prior's mean, others around it.

    The start postures are the same in every run because their seed is fixed.
    """
    if given is not None:
        return with_prior(tree, sight, prior, given[None])
    random = np.random.default_rng(0)
    width = prior.mean.shape[1]
    mean = _placed_mean(tree, sight, prior)
    spread = np.concatenate([np.zeros((1, width)), random.standard_normal((_TRIES - 1, width))])
    starts = tree.plus(np.tile(mean, (_TRIES, 1)), spread * np.minimum(prior.std, 1.0))
    many = MarkerObservation(
        np.repeat(sight.place_m, _TRIES, axis=0), np.repeat(sight.weight, _TRIES, axis=0)
    )
    wide = Prior(np.repeat(mean, _TRIES, axis=0), prior.std)
    q = with_prior(tree, many, wide, starts)
    away = tree.minus(q, wide.mean) / wide.std
    residual = np.where(many.weight[..., None] > 0.0, many.place_m - tree.at(q), 0.0) * many.weight[..., None]
    cost = np.sum(residual**2, axis=(1, 2)) + np.sum(away**2, axis=1)
    best = int(np.argmin(cost))
    return np.asarray(q[best : best + 1])


def anchor_postures(
    tree: PointTree,
    sight: MarkerObservation,
    prior: Prior,
    frames: Any,
    given: Floats | None,
    progress: Told | None,
) -> Floats:
    """Postures (A, c) of some frames, each fitted from its neighbour's, beginning with the most visible markers.

    The prior's mean is the neighbour's posture, so undetermined directions keep its values.
    """
    seen = (sight.weight[frames] > 0.0).sum(axis=1)
    seed = int(np.argmax(seen))
    rows = sight.rows(frames)
    q = np.tile(prior.mean[0], (len(frames), 1))
    q[seed] = first_posture(tree, rows.rows(slice(seed, seed + 1)), Prior(prior.mean[:1], prior.std), given)[
        0
    ]
    done = 0
    for way in (range(seed + 1, len(frames)), range(seed - 1, -1, -1)):
        here = q[seed : seed + 1]
        for k in way:
            here = with_prior(tree, rows.rows(slice(k, k + 1)), Prior(here, prior.std), here)
            q[k] = here[0]
            done += 1
            if progress is not None:
                progress(done / len(frames))
    return q


def between_anchors(tree: PointTree, at_s: Floats, anchors_s: Floats, q: Floats) -> Floats:
    """Postures (T, c) at all time stamps, interpolated linearly between the anchors; rotations take the shorter way."""
    found = np.stack([np.interp(at_s, anchors_s, q[:, k]) for k in range(q.shape[1])], axis=1)
    for columns in tree.rotations:
        quat = continuous_quat(quat_from_rotvec(q[:, columns]))
        line = np.stack([np.interp(at_s, anchors_s, quat[:, k]) for k in range(4)], axis=1)
        found[:, columns] = rotvec_from_quat(line / np.linalg.norm(line, axis=1, keepdims=True))
    return found


def _placed_mean(tree: PointTree, sight: MarkerObservation, prior: Prior) -> Floats:
    """The prior's mean (1, c), with free joints of the root moved to the markers."""
    mean = np.array(prior.mean[:1])
    places = np.where(sight.weight[..., None] > 0.0, sight.place_m, np.nan)
    offset = np.nanmean(places - tree.at(mean), axis=(0, 1)) if np.isfinite(places).any() else np.zeros(3)
    free = [
        k
        for k, name in enumerate(tree.model.coordinate_names)
        if prior.std[k] == _PLACE_STD_M and name[-2:] == ".x"
    ]
    for k in free[:1]:
        _, slopes = tree.with_slopes(mean)
        seen = sight.weight[0] > 0.0
        # the derivatives of any point are the axes of the free joint, in root axes
        axes = slopes[0, int(np.argmax(seen))][:, k : k + 3]
        if np.linalg.norm(axes) > 0.0:
            mean[0, k : k + 3] += axes.T @ offset
    return mean
