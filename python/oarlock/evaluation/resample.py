"""Interpolates a ground truth at the time stamps of a track. Used by all evaluations."""

from __future__ import annotations

import numpy as np

from oarlock.evaluation.interval import STAMP_TOLERANCE_S
from oarlock.model.rotation import continuous_quat
from oarlock.storage.arrays import Bools, Floats, Indices
from oarlock.storage.errors import DataError
from oarlock.storage.extras import FULL, optional


def resample(time_s: Floats, value: Floats, at_s: Floats, circular: bool = False) -> Floats:
    """Values (T,) at other time stamps (N,), by a cubic spline through each stretch without a gap.

    NaN outside the range of ``time_s`` and inside gaps (runs of NaN). Where time stamps agree within 1e-9 s the value
    is copied. ``circular``: angles in rad that may jump by 2 pi are unwrapped first, so that no jump is interpolated.
    """
    result = np.full(len(at_s), np.nan)
    if not len(time_s):
        return result
    if np.any(np.diff(time_s) <= 0):
        first = int(np.argmax(np.diff(time_s) <= 0))
        raise DataError(
            f"truth time stamps are not increasing: {time_s[first]:.6f} s is followed by "
            f"{time_s[first + 1]:.6f} s (sample {first + 1}). Sort the truth by time and drop repeated stamps."
        )
    for start, stop in _runs(np.isfinite(value)):
        _fill(result, time_s[start:stop], value[start:stop], at_s, circular)
    nearest, same = _coincident(time_s, at_s)
    result[same] = value[nearest[same]]
    return result


def resample_rotation(time_s: Floats, quat_wxyz: Floats, at_s: Floats) -> Floats:
    """Rotations (T, 4) at other time stamps (N,), (N, 4).

    Each component of the quaternion, with continuous sign, is resampled like a value; the result is normalised.
    """
    quat = continuous_quat(quat_wxyz)
    found = np.stack([resample(time_s, quat[:, k], at_s) for k in range(4)], axis=1)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _fill(result: Floats, time_s: Floats, value: Floats, at_s: Floats, circular: bool) -> None:
    inside = (at_s >= time_s[0]) & (at_s <= time_s[-1])
    if len(time_s) > 1 and inside.any():
        smooth = np.unwrap(value) if circular else value
        interpolate = optional("scipy.interpolate", FULL, "a comparison at other time stamps")
        result[inside] = interpolate.CubicSpline(time_s, smooth)(at_s[inside])


def _coincident(time_s: Floats, at_s: Floats) -> tuple[Indices, Bools]:
    right = np.clip(np.searchsorted(time_s, at_s), 1, max(len(time_s) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(time_s) - 1)
    nearest = np.where(np.abs(time_s[right] - at_s) < np.abs(at_s - time_s[left]), right, left)
    return nearest, np.abs(time_s[nearest] - at_s) <= STAMP_TOLERANCE_S


def _runs(good: Bools) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
