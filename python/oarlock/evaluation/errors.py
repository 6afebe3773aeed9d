"""Error statistics of joints and scores of frame positions, for `evaluate`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock._core import Model
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.resample import resample, resample_rotation
from oarlock.evaluation.scores import JointScore, PositionScore
from oarlock.model.coordinates import JointPart, parts
from oarlock.model.rotation import quat_from_rotvec, rotvec_between, wrap
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.progress import Told
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.track import Track

LANDMARKS = frozenset({"shoulder", "elbow", "wrist", "hand"})
"""Words in a frame's name that mark it as a landmark."""

OBSERVED_SHARE = 0.5
"""A joint counts as observed if all its coordinates are observed in at least this share of the rows."""

CONSTANT = 1e-9
"""A signal that varies by less than this (rad or m) counts as constant: its correlation is not computed."""


def true_values(track: Track, truth: Track, part: JointPart) -> Floats:
    """Truth at the track's time stamps: (T, 1), a position (T, 3) or quat_wxyz (T, 4); NaN where missing."""
    other = next((p for p in parts(truth.coordinate_names) if p.name == part.name), None)
    if other is None or other.kind != part.kind:
        return np.full((len(track.time_s), 4 if part.kind == "rotation" else len(part.columns)), np.nan)
    values = truth.q[:, list(other.columns)]
    if part.kind == "rotation":
        return resample_rotation(truth.time_s, quat_from_rotvec(values), track.time_s)
    hinge = part.kind == "scalar" and track[part.joint].unit == "rad"
    columns = [resample(truth.time_s, column, track.time_s, circular=hinge) for column in values.T]
    return np.stack(columns, axis=1)


def part_error(track: Track, truth: Track, part: JointPart) -> Floats:
    """Estimate minus truth at the track's stamps, rad or m; NaN where either is missing.

    (T, 1) for a hinge, rad in (-pi, pi], and for a slide; (T, 3) for a position, in its axes; for a rotation -e (T, 3)
    with e = Log(R_est' R_true), in the child's axes, the definition that `Track.q_std` uses.
    """
    value, true = track.q[:, list(part.columns)], true_values(track, truth, part)
    if part.kind == "rotation":
        return -rotvec_between(quat_from_rotvec(value), true)
    error = value - true
    return wrap(error) if part.kind == "scalar" and track[part.joint].unit == "rad" else error


def seen(track: Track, part: JointPart, kept: Bools) -> bool:
    """Whether the part is observed in at least half of the kept rows (T,), the same share as in `observed_joints`."""
    return bool(np.mean(track.observed[kept][:, list(part.columns)].all(axis=1)) >= OBSERVED_SHARE)


def scalar_score(
    name: str, unit: str, error: Floats, std: Floats, correlated: float, note: str = ""
) -> JointScore:
    """The score of errors (N,), N > 0, with the estimated standard deviations (N,)."""
    banded = np.isfinite(std) & (std > 0)
    ratio = error[banded] / std[banded]
    return JointScore(
        name=name,
        unit=unit,
        observed=True,
        note=note,
        samples=len(error),
        rmse=rms(error),
        bias=float(np.mean(error)),
        correlation=correlated,
        coverage=mean_of(np.abs(ratio) <= NORMAL_95),
        nees=mean_of(ratio**2),
        mean_std=mean_of(std[banded]),
    )


def landmark_frames(track: Track, truth: Track) -> tuple[str, ...]:
    """Frames called shoulder, elbow, wrist or hand; if there are none, the frames without child frames."""
    if track.model is None or truth.model is None:
        return ()
    names = tuple(track.model.frame_names)
    known = set(truth.model.frame_names)
    landmarks = tuple(name for name in names if LANDMARKS & set(name.split("_")))
    return tuple(name for name in landmarks or _leaves(track.model, names) if name in known)


def _leaves(model: Model, names: Sequence[str]) -> tuple[str, ...]:
    carrying = {frame.parent for frame in model.describe().frames}
    return tuple(name for name in names if name not in carrying)


def position_scores(
    track: Track, truth: Track, window: Interval, frames: Sequence[str], told: Told | None = None
) -> tuple[PositionScore, ...]:
    """One score per frame, positions in root axes; frames without any common finite sample are left out."""
    if not frames:
        return ()
    kept = window.of(track.time_s)
    at_s = track.time_s[kept]
    estimates, truths = track.positions_of(frames)[kept], truth.positions_of(frames)
    scores = []
    for k, frame in enumerate(frames):
        true = [resample(truth.time_s, truths[:, k, axis], at_s) for axis in range(3)]
        std = track.frame_position_stds(frame)[kept]
        scores.append(position_score(frame, estimates[:, k], np.stack(true, axis=1), std))
        if told is not None:
            told((k + 1) / len(frames))
    return tuple(score for score in scores if score.samples)


def position_score(frame: str, estimate: Floats, reference: Floats, std: Floats) -> PositionScore:
    """The score of positions (N, 3) with their standard deviations (N, 3), m."""
    good = np.isfinite(estimate).all(axis=1) & np.isfinite(reference).all(axis=1)
    error = estimate[good] - reference[good]
    std = std[good]
    banded = np.isfinite(std) & (std > 0)
    pairs = zip(estimate[good].T, reference[good].T, strict=True)
    x, y, z = (rms(error[:, k]) for k in range(3))
    cx, cy, cz = (correlation(a, b) for a, b in pairs)
    return PositionScore(
        frame=frame,
        samples=int(good.sum()),
        rmse_m=float(np.sqrt(x * x + y * y + z * z)),
        axis_rmse_m=(x, y, z),
        axis_correlation=(cx, cy, cz),
        coverage=mean_of(np.abs(error[banded]) <= NORMAL_95 * std[banded]),
    )


def rms(error: Floats) -> float:
    """Root mean square, in the unit of the error; NaN for an empty array."""
    return float(np.sqrt(np.mean(error**2))) if len(error) else float("nan")


def correlation(a: Floats, b: Floats) -> float:
    """Pearson's correlation of two (N,) signals; NaN where either is constant."""
    if len(a) < 2 or np.ptp(a) <= CONSTANT or np.ptp(b) <= CONSTANT:
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def mean_of(values: Floats | Bools) -> float:
    """Mean; NaN for an empty array."""
    return float(np.mean(values)) if len(values) else float("nan")
