"""Scores of joints for `evaluate`: one error for hinges and slides, three components for ball and free joints."""

from __future__ import annotations

import numpy as np

from oarlock.evaluation.angles import angle_error, named_angles
from oarlock.evaluation.errors import (
    CONSTANT,
    correlation,
    mean_of,
    part_error,
    rms,
    scalar_score,
    seen,
    true_values,
)
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.scores import JointScore
from oarlock.model.coordinates import JointPart, parts
from oarlock.model.rotation import mean_quat, quat_from_rotvec, quat_inverse, quat_product, rotvec_from_quat
from oarlock.storage.arrays import Bools, Floats
from oarlock.tracking.track import Track


def joint_scores(track: Track, truth: Track, window: Interval) -> tuple[JointScore, ...]:
    """One score per joint of the track, in its order, two for a free joint.

    A joint that cannot be scored gets a note.
    """
    kept = window.of(track.time_s)
    return tuple(_score(track, truth, part, kept) for part in parts(track.coordinate_names))


def _score(track: Track, truth: Track, part: JointPart, kept: Bools) -> JointScore:
    unit = part_unit(track, part)
    if not seen(track, part, kept):
        return JointScore.unscored(part.name, unit, "not observed")
    error = part_error(track, truth, part)
    good = kept & np.isfinite(error).all(axis=1)
    if not good.any():
        return JointScore.unscored(part.name, unit, "no truth")
    columns = list(part.columns)
    value, std = track.q[good][:, columns], track.q_std[good][:, columns]
    if part.kind == "scalar":
        smooth = np.unwrap(value[:, 0]) if unit == "rad" else value[:, 0]
        related = correlation(smooth, smooth - error[good, 0])
        return scalar_score(part.name, unit, error[good, 0], std[:, 0], related)
    true = true_values(track, truth, part)[good]
    if part.kind == "position":
        return _vector_score(part, unit, error[good], std, (value, true), ())
    signals = _about_mean(quat_from_rotvec(value), true)
    return _vector_score(part, unit, error[good], std, signals, _angle_scores(track, truth, part, good))


def part_unit(track: Track, part: JointPart) -> str:
    """The SI unit of a part: rad or m."""
    kinds = {"rotation": "rad", "position": "m"}
    return kinds.get(part.kind) or str(track[part.joint].unit)


def _vector_score(
    part: JointPart,
    unit: str,
    error: Floats,
    std: Floats,
    signals: tuple[Floats, Floats],
    angles: tuple[JointScore, ...],
) -> JointScore:
    """The score of errors (N, 3), with standard deviations (N, 3); signals are estimate and truth (N, 3)."""
    components = tuple(
        scalar_score(
            f"{part.joint}.{label}", unit, error[:, k], std[:, k], _related(*(s[:, [k]] for s in signals))
        )
        for k, label in enumerate(part.labels)
    )
    claimed = np.linalg.norm(std, axis=1)
    return JointScore(
        name=part.name,
        unit=unit,
        observed=True,
        note="",
        samples=len(error),
        rmse=rms(np.linalg.norm(error, axis=1)),
        bias=float(np.linalg.norm(error.mean(axis=0))),
        correlation=_related(*signals),
        coverage=float(np.mean([score.coverage for score in components])),
        nees=float(np.mean([score.nees for score in components])),
        mean_std=mean_of(claimed[np.isfinite(claimed)]),
        parts=(*components, *angles),
    )


def _about_mean(estimate: Floats, true: Floats) -> tuple[Floats, Floats]:
    """Rotation vectors (N, 3) of estimate and truth from the truth's mean posture, each pair on the same side of pi."""
    home = quat_inverse(mean_quat(true))
    a, b = (rotvec_from_quat(quat_product(home, q)) for q in (estimate, true))
    length = np.linalg.norm(a, axis=1, keepdims=True)
    other = a - 2 * np.pi * a / np.where(length > 0, length, 1.0)
    nearer = np.linalg.norm(a - b, axis=1, keepdims=True) <= np.linalg.norm(other - b, axis=1, keepdims=True)
    return np.where(nearer, a, other), b


def _related(a: Floats, b: Floats) -> float:
    """Correlation of two signals (N, k), their components taken together; NaN where either is constant."""
    if len(a) < 2 or max(np.ptp(a, axis=0)) <= CONSTANT or max(np.ptp(b, axis=0)) <= CONSTANT:
        return float("nan")
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return float(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b)))


def _angle_scores(track: Track, truth: Track, part: JointPart, kept: Bools) -> tuple[JointScore, ...]:
    """Scores of the named angles, without the samples near a pole of estimate or truth."""
    angles, error = named_angles(track, part), angle_error(track, truth, part)
    clear = kept & np.isfinite(error).all(axis=1)
    if not clear.any():
        return tuple(JointScore.unscored(name, "rad", "near singular") for name in angles.names)
    share = 1.0 - np.count_nonzero(clear) / np.count_nonzero(kept)
    left_out = f"{100 * share:.0f} % near singular, left out" if share else ""
    return tuple(
        scalar_score(name, "rad", wrong, std, correlation(value, value - wrong), left_out)
        for name, wrong, std, value in zip(
            angles.names, error[clear].T, angles.std[clear].T, angles.value[clear].T, strict=True
        )
    )
