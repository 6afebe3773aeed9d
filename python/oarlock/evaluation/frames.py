"""`evaluate_frame_orientations`: frame orientations compared with ground truth or another measuring system.

Without a magnetometer the heading of the whole body is arbitrary: a rotation of body and world about the vertical
changes no reading. A track may therefore be rotated by one heading, the same for all frames and times, before it is
compared. Alternatively, the orientation of one frame relative to another is compared, which does not depend on heading.

Definitions as in D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation
Estimation", Data 6(7), 2021.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oarlock.evaluation.errors import rms
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.orientation_scores import OrientationEvaluation, OrientationScore
from oarlock.evaluation.reference import Reference
from oarlock.evaluation.resample import resample_rotation
from oarlock.model.rotation import quat_from_matrix, quat_inverse, quat_product
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.track import Track


def evaluate_frame_orientations(
    track: Track,
    reference: Track | Reference,
    frames: Sequence[str] | Mapping[str, str] | None = None,
    *,
    relative_to: str | None = None,
    remove_heading: bool = False,
    start_s: float = 2.0,
    end_s: float | None = None,
) -> OrientationEvaluation:
    """Score the orientation of frames, in the axes of the root or of another frame.

    Args:
        track: the estimate.
        reference: ground truth, or orientations from another system whose world has z up; its x axis is assumed along
            the model's `forward`. It is interpolated at the track's time stamps, but not across gaps.
        frames: frames to score, or a mapping frame -> name in the reference. None scores every frame whose name occurs
            in the reference; if the reference is a track, every frame that moves.
        relative_to: compare orientations relative to this frame. If the reference has another name for it, it must be
            in the mapping.
        remove_heading: before the comparison, rotate the track about the vertical by the one angle that minimises the
            errors of all scored frames (least squares of the sines of half the error angles).
        start_s: time after the track's first time stamp that is not scored, s.
        end_s: end of the scored part, s after the track's first time stamp; None scores to the end.

    Returns:
        For each frame the RMSE (rad) of the whole angle and of its two parts: inclination (angle between the verticals)
        and heading (rotation about the vertical). Relative orientations are not split.

    Raises:
        DataError: a frame is unknown, there is no sample to score or no model, or both `relative_to` and
            `remove_heading` are given.
    """
    if relative_to is not None and remove_heading:
        raise DataError(
            "evaluate_frame_orientations: orientations relative to a frame have no heading to remove; "
            "leave out relative_to or remove_heading"
        )
    names = _names(track, reference, frames)
    window = Interval.after(track.time_s, start_s)
    end = window.end_s if end_s is None else min(window.end_s, float(track.time_s[0]) + end_s)
    kept = Interval(window.start_s, end).of(track.time_s) & _counts(reference, track.time_s)
    errors = {
        frame: _error(track, reference, frame, names, relative_to) for frame in names if frame != relative_to
    }
    scored = {frame: error[kept & np.isfinite(error).all(axis=1)] for frame, error in errors.items()}
    if not any(len(error) for error in scored.values()):
        raise DataError(
            f"evaluate_frame_orientations: no sample from {window.start_s:.3f} to {end:.3f} s has both an estimate and "
            f"a reference of {', '.join(scored) or 'any frame'}. Check that both use the same clock"
        )
    up = _up(track)
    heading_rad = _best_heading(np.vstack(list(scored.values())), up) if remove_heading else None
    if heading_rad is not None:
        back = np.concatenate([[np.cos(heading_rad / 2)], -np.sin(heading_rad / 2) * up])
        scored = {frame: quat_product(back, error) for frame, error in scored.items()}
    return OrientationEvaluation(
        frames=tuple(_score(frame, error, up, relative_to) for frame, error in scored.items()),
        relative_to=relative_to,
        removed_heading_rad=heading_rad,
        start_s=float(start_s),
        samples=int(np.count_nonzero(kept)),
        reference=reference.source if isinstance(reference, Reference) else "truth",
    )


def _names(
    track: Track, reference: Track | Reference, frames: Sequence[str] | Mapping[str, str] | None
) -> dict[str, str]:
    """Names in the reference by frame."""
    if track.model is None:
        raise DataError(
            "evaluate_frame_orientations: this track was loaded without its model; load the model file again"
        )
    own = list(track.model.frame_names)
    if isinstance(frames, Mapping):
        names = dict(frames)
    elif frames is not None:
        names = {frame: frame for frame in frames}
    else:
        there = reference.bodies if isinstance(reference, Reference) else _moving_frames(reference)
        names = {frame: frame for frame in own if frame in there}
        if not names:
            raise DataError(
                f"evaluate_frame_orientations: no frame of the model ({', '.join(own)}) has the name of one in the "
                f"reference ({', '.join(there)}); assign names with frames={{frame: name}}"
            )
    for frame in names:
        if frame not in own:
            raise DataError(
                f"evaluate_frame_orientations: the model has no frame '{frame}'. {did_you_mean(frame, own)}"
            )
    return names


def _moving_frames(reference: Track) -> list[str]:
    if reference.model is None:
        return []
    moving: list[str] = []
    for frame in reference.model.describe().frames:
        if frame.joint is not None or frame.parent in moving:
            moving.append(frame.name)
    return moving


def _counts(reference: Track | Reference, time_s: Floats) -> Bools:
    """Mask of the scored time stamps: the flag of the nearest reference sample."""
    if not isinstance(reference, Reference) or reference.scored is None:
        return np.ones(len(time_s), dtype=bool)
    right = np.clip(np.searchsorted(reference.time_s, time_s), 1, max(len(reference.time_s) - 1, 1))
    right = np.minimum(right, len(reference.time_s) - 1)
    left = np.maximum(right - 1, 0)
    nearer_left = time_s - reference.time_s[left] < reference.time_s[right] - time_s
    return np.asarray(reference.scored[np.where(nearer_left, left, right)])


def _error(
    track: Track, reference: Track | Reference, frame: str, names: Mapping[str, str], relative_to: str | None
) -> Floats:
    """Estimate times inverse reference, quat_wxyz (T, 4), in the axes of the root (relative: of that frame)."""
    estimate = track.frame_quat_wxyz(frame, relative_to or "root")
    true = _reference_quat(reference, names[frame], track)
    if relative_to is not None:
        true = quat_product(
            quat_inverse(_reference_quat(reference, names.get(relative_to, relative_to), track)), true
        )
    return quat_product(estimate, quat_inverse(true))


def _reference_quat(reference: Track | Reference, name: str, track: Track) -> Floats:
    """root_from_frame at the track's stamps, (T, 4)."""
    if not isinstance(reference, Reference):
        return resample_rotation(reference.time_s, reference.frame_quat_wxyz(name), track.time_s)
    if name not in reference.quat_wxyz:
        raise DataError(
            f"evaluate_frame_orientations: the {reference.source} reference has no body '{name}'. "
            f"{did_you_mean(name, reference.bodies)}"
        )
    measured = resample_rotation(reference.time_s, reference.quat_wxyz[name], track.time_s)
    return quat_product(_root_from_world(track), measured)


def _up(track: Track) -> Floats:
    assert track.model is not None
    up = np.asarray(track.model.describe().world.up, dtype=np.float64)
    return np.asarray(up / np.linalg.norm(up))


def _root_from_world(track: Track) -> Floats:
    """Root from a world with x forward and z up, quat_wxyz (4,)."""
    assert track.model is not None
    up, forward = _up(track), np.asarray(track.model.describe().world.forward, dtype=np.float64)
    forward = forward - (forward @ up) * up
    forward /= np.linalg.norm(forward)
    return quat_from_matrix(np.stack([forward, np.cross(up, forward), up], axis=1))


def _best_heading(error: Floats, up: Floats) -> float:
    """The rotation about up, rad in [-pi, pi], that fits errors (N, 4) best.

    It maximises the sum of the squared cosines of the remaining half angles. This sum is a quadratic form in cosine and
    sine of the rotation's half angle, so the solution has a closed form.
    """
    w, z = error[:, 0], error[:, 1:] @ up
    return math.atan2(2.0 * float(np.sum(w * z)), float(np.sum(w * w - z * z)))


def _score(frame: str, error: Floats, up: Floats, relative_to: str | None) -> OrientationScore:
    whole = 2.0 * np.arctan2(np.linalg.norm(error[:, 1:], axis=1), np.abs(error[:, 0]))
    parts: dict[str, Any] = {"inclination_rmse_rad": math.nan, "heading_rmse_rad": math.nan}
    if relative_to is None:
        w, along = error[:, 0], error[:, 1:] @ up
        across = np.linalg.norm(error[:, 1:] - along[:, None] * up, axis=1)
        parts["inclination_rmse_rad"] = rms(2.0 * np.arctan2(across, np.hypot(w, along)))
        parts["heading_rmse_rad"] = rms(2.0 * np.arctan2(np.abs(along), np.abs(w)))
    worst = float(whole.max()) if len(whole) else math.nan
    return OrientationScore(frame=frame, samples=len(whole), rmse_rad=rms(whole), worst_rad=worst, **parts)
