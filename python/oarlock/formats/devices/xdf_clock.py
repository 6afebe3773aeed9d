"""Stamps of an XDF stream on the recorder's clock: fit of the clock measurements, resets, jitter. For `devices.xdf`.

The recorder measures every few seconds what to add to a stamp of the sender. A line through these measurements, robust
against single late answers, corrects offset and drift. If the sender's machine was started again, its clock has
another zero: each part has a line of its own.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.devices.xdf_chunks import XdfStream
from oarlock.storage.array_gate import LEAST_INTERVAL_S
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import robust_std

_RESET_S = 1.0
"""Clocks drift by microseconds in a second: a larger step between two measurements is a clock with another zero."""
_WINDOW, _LEAST_SIDE, _LONG = 200, 10, 500
_EXACT_S = 1e-12
_STEPS = 50
_MOST_RESETS, _MOST_GAPS = 100, 5000
_LEAST_LAG, _WANDERS = 10, 2.0
_LEAST_SPACING_S = 2 * LEAST_INTERVAL_S


@dataclass(frozen=True)
class XdfClockFit:
    """Stamps on the recorder's clock, and how they were found.

    Args:
        time_s: (T,) strictly increasing, s.
        resets: how often the sender's clock got another zero.
        offset_s: median of what was added; NaN without measurements.
        drift_ppm: of the longest part; NaN with less than two measurements.
        jitter_s: standard deviation of the stamps about the regular ones; NaN where they were not made regular.
        wanders: whether a stream with a nominal rate has none in fact: its stamps were kept.
        gaps: how often samples are missing between regular ones.
        moved: stamps that were not later than the one before and were set just behind it.
    """

    time_s: Floats
    resets: int
    offset_s: float
    drift_ppm: float
    jitter_s: float
    wanders: bool
    gaps: int
    moved: int


def on_the_recorders_clock(stream: XdfStream) -> XdfClockFit:
    """The stamps of a stream that has samples."""
    raw = stream.raw_time_s
    parts = _parts(stream.measured)
    cuts = _cuts(stream, raw, parts)
    time_s, offset_s, drift = raw.copy(), float("nan"), float("nan")
    lines = [_line(np.array(stream.measured[begin:end])) for begin, end in parts]
    for (begin, end), line in zip(_ranges(cuts, len(raw)), lines, strict=False):
        middle, value, slope = line
        time_s[begin:end] += value + slope * (time_s[begin:end] - middle)
    if lines:
        longest = int(np.argmax([end - begin for begin, end in parts]))
        offset_s, drift = float(np.median(time_s - raw)), 1e6 * lines[longest][2]
    jitter_s, gaps = float("nan"), 0
    wanders = stream.rate_hz > 0.0 and _wanders(time_s)
    if stream.rate_hz and not wanders and len(raw) > 2:
        time_s, jitter_s, gaps = _regular(time_s, cuts)
    spaced, moved = _increasing(time_s)
    return XdfClockFit(spaced, len(cuts), offset_s, drift, jitter_s, wanders, gaps, moved)


def _parts(measured: Sequence[tuple[float, float]]) -> list[tuple[int, int]]:
    """Ranges of measurements between resets; none if so many are resets that no clock was measured."""
    if not measured:
        return []
    steps = np.diff(np.array(measured), axis=0)
    resets = np.flatnonzero((steps[:, 0] < -_RESET_S) | (np.abs(steps[:, 1]) > _RESET_S)) + 1
    return [] if len(resets) > _MOST_RESETS else _ranges(resets.tolist(), len(measured))


def _ranges(cuts: Sequence[int], count: int) -> list[tuple[int, int]]:
    return list(zip([0, *cuts], [*cuts, count], strict=True))


def _cuts(stream: XdfStream, raw: Floats, parts: Sequence[tuple[int, int]]) -> list[int]:
    """The first sample of each part but the first: behind the largest step near the place of the reset in the file."""
    sizes = [len(chunk) for chunk in stream.stamps]
    before = np.repeat(stream.offsets_before, sizes)
    steps = np.abs(np.diff(raw, prepend=raw[:1]))
    cuts: list[int] = []
    for begin, _ in parts[1:]:
        first, stop = (int(i) for i in np.searchsorted(before, [begin - 1, begin + 2]))
        first = max(first, cuts[-1] if cuts else 0)
        near = steps[first:stop]
        cuts.append(first + int(np.argmax(near)) if near.size and near.max() > _RESET_S else max(first, stop))
    return cuts


def _line(measured: Floats) -> tuple[float, float, float]:
    """Middle of the times, value there, slope: a line through the measurements, with Cauchy's weights."""
    time_s, offset_s = measured[:, 0], measured[:, 1]
    middle = float(time_s.mean())
    if len(measured) < 2 or np.ptp(time_s) <= 0.0:
        return middle, float(np.median(offset_s)), 0.0
    away = time_s - middle
    design = np.column_stack([np.ones_like(away), away / np.abs(away).max()])
    found = _robust(design, offset_s)
    return middle, float(found[0]), float(found[1] / np.abs(away).max())


def _robust(design: Floats, wanted: Floats) -> Floats:
    """Least squares with Cauchy's weights; the median of the residuals is the scale."""
    weight = np.ones(len(wanted))
    found: NDArray[np.floating[Any]] = np.zeros(design.shape[1])
    for _ in range(_STEPS):
        root = np.sqrt(weight)[:, None]
        new = np.linalg.lstsq(design * root, wanted * root[:, 0], rcond=None)[0]
        residual = wanted - design @ new
        scale = robust_std(residual)
        if scale <= _EXACT_S or np.array_equal(new, found):
            return np.asarray(new, dtype=np.float64)
        found, weight = new, 1.0 / (1.0 + (residual / (2.0 * scale)) ** 2)
    return np.asarray(found, dtype=np.float64)


def _wanders(time_s: Floats) -> bool:
    """Whether the sender had no regular clock: the stamps then go astray further the longer one waits.

    Jitter of a regular clock is as large after ten times as many samples; that of a random walk is 3.2 times as large.
    """
    lag = min(100, len(time_s) // 20)
    if lag < _LEAST_LAG:
        return False
    near, far = (_spread(time_s[n:] - time_s[:-n]) for n in (lag, 10 * lag))
    return far > _WANDERS * near


def _spread(values: Floats) -> float:
    return robust_std(values - np.median(values))


def _regular(time_s: Floats, cuts: Sequence[int]) -> tuple[Floats, float, int]:
    """Regular stamps: a line through those of each piece without a gap; their jitter, and how many gaps there are."""
    gaps = _gaps(time_s)
    pieces = _ranges(sorted({*gaps, *(cut for cut in cuts if 0 < cut < len(time_s))}), len(time_s))
    step_s = _common_step(time_s, pieces)
    found = np.empty_like(time_s)
    for begin, end in pieces:
        index = np.arange(end - begin) - (end - begin - 1) / 2
        piece = time_s[begin:end]
        if len(piece) >= _LONG:
            half = index[-1]
            value, slope = _robust(np.column_stack([np.ones_like(index), index / half]), piece - piece.mean())
            found[begin:end] = piece.mean() + value + slope / half * index
        else:
            found[begin:end] = index * step_s + np.median(piece - index * step_s)
    return found, float(np.std(time_s - found)), len(gaps)


def _common_step(time_s: Floats, pieces: Sequence[tuple[int, int]]) -> float:
    """The interval between samples, from all pieces together."""
    begins, ends = np.array(pieces).T
    spans, counts = time_s[ends - 1] - time_s[begins], ends - 1 - begins
    longest = int(np.argmax(counts))
    return float(spans[longest] / counts[longest]) if counts[longest] else 0.0


def _gaps(time_s: Floats) -> list[int]:
    """Samples before which others are missing: the stamps after it stay late, which those of a late packet do not.

    Large steps are tried first, so that a gap does not count again at the jitter beside it.
    """
    steps = np.diff(time_s)
    lag = min(len(steps), _WINDOW)
    step_s = float(np.median(time_s[lag:] - time_s[:-lag])) / lag
    away = np.abs(steps - step_s)
    odd = np.flatnonzero(away > max(0.5 * step_s, 4.0 * _spread(steps)))
    found = [0, len(time_s)]
    for index in (odd[np.argsort(-away[odd], kind="stable")][:_MOST_GAPS] + 1).tolist():
        place = bisect(found, index)
        left = _late(time_s, max(found[place - 1], index - _WINDOW), index, step_s)
        right = _late(time_s, index, min(found[place], index + _WINDOW), step_s)
        if min(len(left), len(right)) < _LEAST_SIDE:
            continue
        shift_s = abs(float(np.median(right) - np.median(left)) - step_s * len(left))
        if shift_s > max(0.5 * step_s, 3.0 * (_spread(left) + _spread(right))):
            found.insert(place, index)
    return found[1:-1]


def _late(time_s: Floats, begin: int, end: int, step_s: float) -> Floats:
    """How late each stamp is by a regular clock that starts at the first."""
    return time_s[begin:end] - step_s * np.arange(end - begin)


def _increasing(time_s: Floats) -> tuple[Floats, int]:
    """The stamps, those that are not later than the one before just behind it; and how many were moved."""
    index = np.arange(len(time_s)) * _LEAST_SPACING_S
    spaced: Floats = np.maximum.accumulate(time_s - index) + index
    late = np.diff(time_s, prepend=-np.inf) < LEAST_INTERVAL_S
    if not late.any():
        return time_s, 0
    moved = spaced - time_s > 0.25 * _LEAST_SPACING_S
    return np.where(moved, spaced, time_s), int(moved.sum())
