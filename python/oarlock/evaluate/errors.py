"""Errors of joints and of frame positions, and their summaries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .resample import resample
from .scores import JointScore, PositionScore
from .tracklike import Floats, Interval, TrackLike

LANDMARKS = frozenset({"shoulder", "elbow", "wrist", "hand"})
"""Words in a frame's name that mark it as one people ask for."""

BAND_95 = 1.96
"""Half-width of the 95 % band in standard deviations."""

CONSTANT = 1e-9
"""A signal that moves less than this (rad or m) is constant: its correlation has no meaning."""


def wrap(angle_rad: Floats) -> Floats:
    """The same angle in (-pi, pi], rad."""
    wrapped: Floats = np.pi - np.mod(np.pi - angle_rad, 2 * np.pi)
    return wrapped


def joint_error(track: TrackLike, truth: TrackLike, name: str) -> Floats:
    """Estimate minus truth at the track's stamps, (T,), rad in (-pi, pi] or m; NaN where either is missing."""
    if name not in truth.joint_names:
        return np.full(len(track.time_s), np.nan)
    hinge = track[name].unit == "rad"
    true = resample(
        truth.time_s, truth.q[:, list(truth.joint_names).index(name)], track.time_s, circular=hinge
    )
    error: Floats = track.q[:, list(track.joint_names).index(name)] - true
    return wrap(error) if hinge else error


def joint_scores(track: TrackLike, truth: TrackLike, window: Interval) -> tuple[JointScore, ...]:
    """One score per joint of the track, in its order; joints without observation or truth say so."""
    kept = window.of(track.time_s)
    return tuple(_joint_score(track, truth, i, name, kept) for i, name in enumerate(track.joint_names))


def _joint_score(
    track: TrackLike, truth: TrackLike, i: int, name: str, kept: NDArray[np.bool_]
) -> JointScore:
    unit = track[name].unit
    if np.mean(track.observed[kept, i]) < 0.5:
        return JointScore.unscored(name, unit, "not observed")
    error, value, std = joint_error(track, truth, name)[kept], track.q[kept, i], track.q_std[kept, i]
    good = np.isfinite(error)
    if not good.any():
        return JointScore.unscored(name, unit, "no truth")
    error, value, std = error[good], value[good], std[good]
    banded = np.isfinite(std) & (std > 0)
    ratio = error[banded] / std[banded]
    smooth = np.unwrap(value) if unit == "rad" else value
    return JointScore(
        name=name,
        unit=unit,
        observed=True,
        note="",
        samples=len(error),
        rmse=rms(error),
        bias=float(np.mean(error)),
        correlation=correlation(smooth, smooth - error),
        coverage=_mean(np.abs(ratio) <= BAND_95),
        nees=_mean(ratio**2),
        mean_std=_mean(std[banded]),
    )


def landmark_frames(track: TrackLike, truth: TrackLike) -> tuple[str, ...]:
    """Frames called shoulder, elbow, wrist or hand; if there are none, the frames that carry no other."""
    if track.model is None or truth.model is None:
        return ()
    names = tuple(track.model.frame_names)
    known = set(truth.model.frame_names)
    landmarks = tuple(name for name in names if LANDMARKS & set(name.split("_")))
    return tuple(name for name in landmarks or _leaves(track, names) if name in known)


def _leaves(track: TrackLike, names: Sequence[str]) -> tuple[str, ...]:
    carrying = {frame["parent"] for frame in track.model.describe()["frames"]}
    return tuple(name for name in names if name not in carrying)


def position_scores(
    track: TrackLike, truth: TrackLike, window: Interval, frames: Sequence[str]
) -> tuple[PositionScore, ...]:
    """One score per frame, positions in root axes; frames without any common finite sample are left out."""
    kept = window.of(track.time_s)
    scores = (_position_score(track, truth, frame, kept) for frame in frames)
    return tuple(score for score in scores if score.samples)


def _position_score(track: TrackLike, truth: TrackLike, frame: str, kept: NDArray[np.bool_]) -> PositionScore:
    at_s, estimate, true = (
        track.time_s[kept],
        track.frame_positions(frame)[kept],
        truth.frame_positions(frame),
    )
    reference = np.stack([resample(truth.time_s, true[:, k], at_s) for k in range(3)], axis=1)
    good = np.isfinite(estimate).all(axis=1) & np.isfinite(reference).all(axis=1)
    error = estimate[good] - reference[good]
    pairs = zip(estimate[good].T, reference[good].T, strict=True)
    x, y, z = (rms(error[:, k]) for k in range(3))
    cx, cy, cz = (correlation(a, b) for a, b in pairs)
    return PositionScore(
        frame=frame,
        samples=int(good.sum()),
        rmse_m=float(np.sqrt(x * x + y * y + z * z)),
        axis_rmse_m=(x, y, z),
        axis_correlation=(cx, cy, cz),
    )


def rms(error: Floats) -> float:
    """Root mean square, in the unit of the error; NaN of nothing."""
    return float(np.sqrt(np.mean(error**2))) if len(error) else float("nan")


def correlation(a: Floats, b: Floats) -> float:
    """Pearson's correlation of two (N,) signals; NaN where either is constant."""
    if len(a) < 2 or np.ptp(a) <= CONSTANT or np.ptp(b) <= CONSTANT:
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def _mean(values: NDArray[np.float64] | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
