"""Estimates the clock offset between two recordings of the same movement, for comparisons with markers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import correlate, find_peaks

from oarlock.evaluation.resample import resample
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.even_times import even_times

GRID_S: Final = 0.01
_STRIDE_S: Final = 0.05
"""Speed is a central difference over twice this time: 1 mm of noise causes an error of 14 mm/s."""
_LEAST_OVERLAP_S: Final = 2.0
_ALIKE: Final = 0.01
"""Correlation peaks within this distance of the highest count as equal; the smallest offset is used."""


@dataclass(frozen=True)
class CoarseOffset:
    """Coarse clock offset, accurate to 0.01 s.

    Args:
        offset_s: offset to add to the other's time stamps, s.
        correlation: of the speeds at that offset.
        rivals_s: other offsets that fit equally well, in repeating movements.
    """

    offset_s: float
    correlation: float
    rivals_s: tuple[float, ...]


def coarse_offset(
    own_s: Floats, own_m: Floats, other_s: Floats, other_m: Floats, largest_s: float | None
) -> CoarseOffset:
    """Clock offset with the highest correlation of the points' speeds. Speeds do not depend on axes.

    Args:
        own_s: (T,) stamps.
        own_m: (T, n, 3) points.
        other_s: (S,) stamps by the other clock.
        other_m: (S, n, 3) the same points, in any axes.
        largest_s: largest offset that is searched; None searches all with enough overlap.

    Raises:
        DataError: the overlap is too short, or nothing moves.
    """
    own, other = _speeds(own_s, own_m), _speeds(other_s, other_m)
    start = float(own_s[0] - other_s[0])
    lags, correlation = _correlations(own, other)
    offsets = start + lags * GRID_S
    allowed = np.isfinite(correlation)
    if largest_s is not None:
        allowed &= np.abs(offsets) <= largest_s + GRID_S
    if not allowed.any() or not np.nanmax(correlation[allowed]) > 0.0:
        raise DataError(
            "evaluate_markers: clocks cannot be aligned: track and markers share no two seconds of movement"
            + ("" if largest_s is None else f" within {largest_s:g} s of each other")
            + ". Give align_clock=False if they have the same clock."
        )
    level = np.where(allowed, correlation, -1.0)
    peaks = find_peaks(np.concatenate([[-2.0], level, [-2.0]]))[0] - 1
    alike = peaks[level[peaks] >= level.max() - _ALIKE]
    best = int(alike[np.argmin(np.abs(offsets[alike]))])
    rivals = tuple(float(o) for o in offsets[alike] if abs(o - offsets[best]) > 0.1)
    return CoarseOffset(float(offsets[best]), float(level[best]), rivals)


def _speeds(time_s: Floats, points_m: Floats) -> Floats:
    """Speeds on a regular grid from the first time stamp, (G, n), m/s; NaN where unknown."""
    grid = even_times(time_s, GRID_S, "clocks cannot be aligned")
    found = []
    for k in range(points_m.shape[1]):
        ahead, behind = (
            np.stack([resample(time_s, points_m[:, k, axis], grid + way) for axis in range(3)], axis=1)
            for way in (_STRIDE_S, -_STRIDE_S)
        )
        found.append(np.linalg.norm(ahead - behind, axis=1) / (2.0 * _STRIDE_S))
    return np.stack(found, axis=1)


def _correlations(own: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Lags in grid steps, and the correlation of all points at each lag; NaN if the overlap is too short."""
    lags = np.arange(-(len(other) - 1), len(own), dtype=np.float64)
    sums = np.zeros((6, len(lags)))
    for k in range(own.shape[1]):
        a, b = own[:, k], other[:, k]
        here, there = np.isfinite(a).astype(np.float64), np.isfinite(b).astype(np.float64)
        a, b = np.nan_to_num(a), np.nan_to_num(b)
        pairs = ((a, b), (a, there), (here, b), (a * a, there), (here, b * b), (here, there))
        sums += np.stack([correlate(x, y, mode="full", method="fft") for x, y in pairs])
    product, own_sum, other_sum, own_square, other_square, count = sums
    enough = count >= _LEAST_OVERLAP_S / GRID_S * own.shape[1]
    share = np.maximum(count, 1.0)
    spread = (own_square - own_sum**2 / share) * (other_square - other_sum**2 / share)
    moves = enough & (spread > 1e-9 * np.max(spread, initial=0.0))
    covariance = product - own_sum * other_sum / share
    return lags, np.where(moves, covariance / np.sqrt(np.where(moves, spread, 1.0)), np.nan)
