"""`inverse_kinematics`: joint coordinates of any model from marker trajectories, by least squares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from oarlock.evaluation.markers.attachments import Attachment, GivenAttachments, attachments_of, check_frames
from oarlock.evaluation.markers.gaps import FilledMarkers
from oarlock.evaluation.markers.least_squares import MarkerObservation, PostureSolution, Prior, found_postures
from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.evaluation.markers.posture_fit import PostureFit
from oarlock.evaluation.markers.start import ANCHOR_S, anchor_postures, between_anchors, body_prior
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.model.chain_geometry import posture
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, Told, share, shown

if TYPE_CHECKING:
    from oarlock._core import Model

_FRAMES_AT_ONCE: Final = 500
_FAR_WORSE: Final = 25.0
"""Ratio of a frame's cost to the median above which the frame is fitted again from its neighbours."""


def inverse_kinematics(
    model: Model,
    markers: Markers | FilledMarkers,
    attachments: GivenAttachments,
    *,
    root_from_markers: ArrayLike | None = None,
    added_std_m: ArrayLike | None = None,
    start_q: Mapping[str, float] | ArrayLike | None = None,
    progress: Progress = None,
) -> PostureFit:
    """Joint values that bring the model's points nearest to the markers, frame by frame.

    Each frame is a weighted least-squares problem on the tree (hinges, slides, balls, free joints), solved by
    Levenberg-Marquardt from its neighbours' postures. The model's soft limits are a weak prior. It chooses between
    postures that fit equally well and keeps undetermined joints plausible. It is then removed in directions that the
    markers determine five times better than the prior, so the result has no bias towards the middle of the limits.

    Args:
        model: with the person's lengths.
        markers: in the model's root axes, or see `root_from_markers`; markers without attachment are ignored. A result
            of `fill_gaps` includes the standard deviations of the filled positions.
        attachments: positions of the markers on the model with their standard deviations, or a mapping `{marker:
            frame}` of markers at the origins of frames (joint centres).
        root_from_markers: (4, 4) pose of the measuring system in root axes; None if its axes are the root's.
        added_std_m: (T, n) by frame and marker of `markers`, a standard deviation in addition to that of the
            attachment, m: `fill_gaps` gives it for filled positions.
        start_q: initial posture for the frame with the most markers: values by name (others 0) or an array. None tries
            many.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        Values, standard deviations and residuals, and which joints the markers do not determine.

    Source: T.-W. Lu, J. J. O'Connor 1999, "Bone position estimation from skin marker co-ordinates using global
    optimisation with joint constraints", Journal of Biomechanics 32. This implementation differs in the prior and in
    the standard deviations.

    Raises:
        DataError: no attached marker is in the file, the model lacks a frame, or no instant has a marker.
    """
    if isinstance(markers, FilledMarkers):
        added_std_m = markers.std_m if added_std_m is None else added_std_m
        markers = markers.markers
    used = _used(model, markers, attachments)
    placed = (
        markers if root_from_markers is None else markers.moved(real_array(root_from_markers, (4, 4), "pose"))
    )
    placed = placed.select([a.marker for a in used])
    if not placed.seen.any():
        raise DataError("inverse_kinematics: none of the attached markers is ever visible")
    tree = PointTree(model, used)
    sight = MarkerObservation(
        np.nan_to_num(placed.position_m), placed.seen / _std(markers, used, added_std_m)
    )
    mean, std = body_prior(model)
    prior = Prior(np.tile(mean, (len(placed), 1)), std)
    start = None if start_q is None else posture(model, start_q)
    with shown(progress, "fitting postures") as told:
        found = _all_frames(tree, placed.time_s, sight, prior, start, told)
    return _fit(tree, placed, sight, used, found)


def _std(markers: Markers, used: tuple[Attachment, ...], added_std_m: ArrayLike | None) -> Floats:
    """Standard deviations (T, n) of the used markers' coordinates, m."""
    own = np.array([a.std_m for a in used])
    if added_std_m is None:
        return np.tile(own, (len(markers), 1))
    added = real_array(added_std_m, (len(markers), len(markers.names)), "inverse_kinematics, added_std_m")
    return np.asarray(np.hypot(own, added[:, [markers.index(a.marker) for a in used]]))


def _used(model: Model, markers: Markers, attachments: GivenAttachments) -> tuple[Attachment, ...]:
    given = attachments_of(attachments)
    check_frames(model, [a.frame for a in given], "attachments")
    used = tuple(a for a in given if a.marker in markers.names)
    if not used:
        raise DataError(
            f"inverse_kinematics: none of the attached markers ({', '.join(a.marker for a in given[:8])}) is in the "
            f"trial ({', '.join(markers.names[:8])})"
        )
    return used


def _all_frames(
    tree: PointTree,
    time_s: Floats,
    sight: MarkerObservation,
    prior: Prior,
    start: Floats | None,
    progress: Told | None,
) -> PostureSolution:
    anchors = _anchors(time_s)
    walked = anchor_postures(tree, sight, prior, anchors, start, share(progress, 0.0, 0.5))
    first = between_anchors(tree, time_s, time_s[anchors], walked)
    progress_of_fit = share(progress, 0.5, 1.0)
    chunks = []
    for k in range(0, len(time_s), _FRAMES_AT_ONCE):
        rows = slice(k, k + _FRAMES_AT_ONCE)
        chunks.append(found_postures(tree, sight.rows(rows), Prior(first[rows], prior.std), first[rows]))
        if progress_of_fit is not None:
            progress_of_fit(min(1.0, (k + _FRAMES_AT_ONCE) / len(time_s)))
    fields = ("q", "std", "determined", "settled", "cost")
    found = PostureSolution(*(np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in fields))
    return _refitted(tree, sight, prior, found)


def _anchors(time_s: Floats) -> Floats:
    """Frames about a tenth of a second apart, the last included."""
    found = [0]
    for k in range(1, len(time_s)):
        if time_s[k] - time_s[found[-1]] >= ANCHOR_S or k == len(time_s) - 1:
            found.append(k)
    return np.array(found)


def _refitted(
    tree: PointTree, sight: MarkerObservation, prior: Prior, found: PostureSolution
) -> PostureSolution:
    """Fit frames with a large residual or without convergence again, starting from the nearest good ones."""
    bad = ~found.settled | (found.cost > _FAR_WORSE * (float(np.median(found.cost)) + 1.0))
    good = np.flatnonzero(~bad)
    rows = np.flatnonzero(bad)
    if not rows.size or not good.size:
        return found
    after = np.clip(np.searchsorted(good, rows), 0, len(good) - 1)
    for near in (good[after], good[np.maximum(after - 1, 0)]):
        start = found.q[near]
        again = found_postures(tree, sight.rows(rows), Prior(start, prior.std), start)
        better = again.cost < found.cost[rows]
        for name in ("q", "std", "determined", "settled", "cost"):
            getattr(found, name)[rows[better]] = getattr(again, name)[better]
    return found


def _fit(
    tree: PointTree,
    placed: Markers,
    sight: MarkerObservation,
    used: tuple[Attachment, ...],
    found: PostureSolution,
) -> PostureFit:
    residual = placed.position_m - tree.at(found.q)
    # each determined direction removes one degree of freedom of the residuals
    free = int(3 * placed.seen.sum()) - int(found.determined.sum())
    spent = float(np.nansum((residual * sight.weight[..., None]) ** 2))
    scale = float(np.sqrt(spent / free)) if free > 0 else float("nan")
    return PostureFit(
        model=tree.model,
        time_s=placed.time_s,
        q=found.q,
        q_std=found.std * (max(1.0, scale) if np.isfinite(scale) else 1.0),
        determined=found.determined & tree.touched,
        settled=found.settled,
        attachments=used,
        residual_m=residual,
        noise_scale=scale,
    )
