"""Finds movement that repeats, such as steps or reaches, and cuts it into cycles.

In windows of ten seconds the posture is compared with itself a lag later: the correlation of all angles together, each
with the energy of its movement. The shortest lag of a clear maximum is the period. Windows of one period form a
repetition, whose cycles begin where its leading angle is largest. The time that no repetition covers is searched again
in windows of six seconds, for short stretches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from oarlock.movement.angles import MovementAngle
from oarlock.storage.arrays import Floats, Indices
from oarlock.storage.even_times import even_times_of_stretches

WINDOWS_S, HOP_S, RATE_HZ = (10.0, 6.0), 1.0, 25.0
SHORTEST_S = 0.3
LEAST_MOVEMENT_DEG = 5.0
"""Smallest standard deviation of the angle that moves most, in a window that is searched."""
CLEAR = 0.8
"""Smallest correlation of the posture with itself one period later."""
NEAR_BEST = 0.92
"""Shorter lags with at least this share of the best correlation are preferred: two cycles repeat as well as one."""
SAME_PERIOD = 0.2
"""Largest relative change of the period from one window to the next of a repetition."""
UNEVEN = 0.35
"""Largest relative difference of a cycle's duration from the period."""
LEAST_CYCLES = 3
POINTS = 101
"""Points of a course over a cycle: 0 to 100 %."""


@dataclass(frozen=True, eq=False)
class Repetition:
    """A stretch of movement that repeats.

    Args:
        lead: name of the angle whose maxima begin the cycles.
        begins_s: (n + 1,) start of each of n cycles, and the end of the last one, s.
        correlation: of the posture with itself one period later, median over the windows.
    """

    lead: str
    begins_s: Floats
    correlation: float

    @property
    def count(self) -> int:
        """Number of cycles."""
        return len(self.begins_s) - 1

    @property
    def peaks(self) -> int:
        """How often the leading angle was largest: what a person counts; one more than whole cycles."""
        return len(self.begins_s)

    @property
    def durations_s(self) -> Floats:
        """(n,) duration of each cycle, s."""
        return np.diff(self.begins_s)

    @property
    def period_s(self) -> float:
        """Mean duration of a cycle, s."""
        return float(self.durations_s.mean())


def find_cycles(
    time_s: Floats, angles: Sequence[MovementAngle], taken: Sequence[Repetition] = ()
) -> tuple[Repetition, ...]:
    """The repetitions of a movement, the one with the most cycles first; none if nothing repeats three times.

    They do not overlap: of cycles that two share, the one with more of them keeps them. `taken`: repetitions whose time
    is not searched.
    """
    if len(time_s) < 2 or not angles or time_s[-1] - time_s[0] < LEAST_CYCLES * SHORTEST_S:
        return ()
    even_s = even_times_of_stretches(time_s, 1.0 / RATE_HZ)
    known = [np.isfinite(angle.value_deg) for angle in angles]
    courses = zip(known, angles, strict=True)
    rows = np.stack([np.interp(even_s, time_s[k], angle.value_deg[k]) for k, angle in courses], axis=1)
    found: list[Repetition] = []
    for window_s in WINDOWS_S:
        width = min(round(window_s * RATE_HZ), len(rows))
        starts = [
            start
            for start in range(0, len(rows) - width + 1, round(HOP_S * RATE_HZ))
            if not any(_overlap(one, even_s[start], even_s[start + width - 1]) for one in (*taken, *found))
        ]
        windows = [(start, *_period(rows[start : start + width])) for start in starts]
        fresh = [_repetition(even_s, rows, group, width, angles) for group in _groups(windows)]
        found = _apart([*found, *(one for one in fresh if one is not None)])
    return tuple(found)


def _overlap(one: Repetition, start_s: float, end_s: float) -> bool:
    """Whether both share more than half a cycle of the repetition, or more than half of the interval."""
    shared_s = float(min(end_s, one.begins_s[-1]) - max(start_s, one.begins_s[0]))
    return shared_s > 0.5 * min(one.period_s, end_s - start_s)


def _apart(found: Sequence[Repetition]) -> list[Repetition]:
    """The repetitions, the one with the most cycles first, each without cycles that one before it has."""
    kept: list[Repetition] = []
    for one in sorted(found, key=lambda one: -one.count):
        own = [
            k
            for k in range(one.count)
            if not any(_overlap(other, *one.begins_s[k : k + 2]) for other in kept)
        ]
        runs = np.split(own, np.flatnonzero(np.diff(own) > 1) + 1)
        longest = max(runs, key=len)
        if len(longest) >= LEAST_CYCLES:
            kept.append(replace(one, begins_s=one.begins_s[longest[0] : longest[-1] + 2]))
    return sorted(kept, key=lambda one: -one.count)


def cycle_courses(time_s: Floats, value: Floats, begins_s: Floats) -> Floats:
    """The course of a quantity (T,) over each of n cycles, (n, 101): 0 to 100 %, linear between rows; NaN in gaps."""
    shares = np.linspace(0.0, 1.0, POINTS)
    places = begins_s[:-1, None] + shares * np.diff(begins_s)[:, None]
    return np.asarray(np.interp(places, time_s, value))


def peaks_of(values: Floats, prominence: float, distance: float = 1.0) -> Indices:
    """Places of the local maxima of (N,) numbers, as `scipy.signal.find_peaks`: the middle of each flat top.

    Args:
        values: without a gap.
        prominence: least height above the higher of the lowest values on both sides up to a higher value or the end.
        distance: of maxima that are closer, the higher one stays.
    """
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    ends, heights = np.append(begins[1:], len(values)) - 1, values[begins]
    tops = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:])) + 1
    peaks = (begins[tops] + ends[tops]) // 2
    stays = np.ones(len(peaks), dtype=bool)
    for k in np.argsort(values[peaks])[::-1]:
        if stays[k]:
            stays &= (np.abs(peaks - peaks[k]) >= distance) | (np.arange(len(peaks)) == k)
    found = [peak for peak in peaks[stays] if _prominence(values, int(peak)) >= prominence]
    return np.array(found, dtype=np.intp)


def _prominence(values: Floats, peak: int) -> float:
    higher = np.flatnonzero(values > values[peak])
    before, after = higher[higher < peak], higher[higher > peak]
    left = values[before[-1] + 1 if len(before) else 0 : peak + 1].min()
    right = values[peak : after[0] if len(after) else len(values)].min()
    return float(values[peak] - max(left, right))


def _period(rows: Floats) -> tuple[float, float]:
    """Period in samples and correlation one period later; (0, 0) if the window does not repeat."""
    moved = rows - rows.mean(axis=0)
    if moved.std(axis=0).max() < LEAST_MOVEMENT_DEG:
        return 0.0, 0.0
    lags = np.arange(1, len(rows) // 2 + 1)
    correlation = np.array([_correlation(moved, int(lag)) for lag in lags])
    peaks = peaks_of(correlation, prominence=0.1)
    peaks = peaks[(correlation[peaks] >= CLEAR) & (lags[peaks] >= SHORTEST_S * RATE_HZ)]
    if not len(peaks):
        return 0.0, 0.0
    best = correlation[peaks].max()
    first = next(peak for peak in peaks if correlation[peak] >= NEAR_BEST * best)
    return float(lags[first]), float(correlation[first])


def _correlation(rows: Floats, lag: int) -> float:
    return _alike(rows[:-lag], rows[lag:])


def _groups(windows: Sequence[tuple[int, float, float]]) -> list[list[tuple[int, float, float]]]:
    """Runs of neighbouring windows that repeat with about the same period."""
    groups: list[list[tuple[int, float, float]]] = []
    for window in windows:
        start, period, _ = window
        if period == 0.0:
            continue
        last_start, last_period = groups[-1][-1][:2] if groups else (-np.inf, 1.0)
        near = start - last_start <= HOP_S * RATE_HZ and abs(period / last_period - 1.0) <= SAME_PERIOD
        if near:
            groups[-1].append(window)
        else:
            groups.append([window])
    return groups


def _repetition(
    even_s: Floats,
    rows: Floats,
    group: Sequence[tuple[int, float, float]],
    width: int,
    angles: Sequence[MovementAngle],
) -> Repetition | None:
    period = float(np.median([window[1] for window in group]))
    start, stop = group[0][0], group[-1][0] + width
    part = rows[start:stop]
    lag = round(period)
    moved = part - part.mean(axis=0)
    strength = [_correlation(moved[:, k : k + 1], lag) * moved[:, k].std() for k in range(part.shape[1])]
    lead = int(np.argmax(strength))
    # A window must lie in the movement as a whole, so the first and the last cycles stand outside of all windows.
    course = rows[:, lead]
    peaks = peaks_of(course, 0.4 * np.ptp(part[:, lead]), distance=0.6 * period)
    run = _regular(peaks[(peaks >= start) & (peaks < stop)].astype(np.float64), period)
    if len(run) <= LEAST_CYCLES:
        return None
    run = _extended(rows, run, peaks.astype(np.float64), period)
    begins_s = even_s[0] + np.array([_vertex(course, int(peak)) for peak in run]) / RATE_HZ
    correlation = float(np.median([window[2] for window in group]))
    return Repetition(angles[lead].name, begins_s, correlation)


def _extended(rows: Floats, run: Floats, peaks: Floats, period: float) -> Floats:
    """The run with the cycles before and after it that are like its mean."""
    times = np.arange(len(rows), dtype=np.float64)

    def courses(begins: Floats) -> Floats:
        return np.stack([cycle_courses(times, column, begins) for column in rows.T], axis=2)

    mean = courses(run).mean(axis=0)

    def like(begin: float, end: float) -> bool:
        near = abs((end - begin) / period - 1.0) <= UNEVEN
        both = np.stack([mean, courses(np.array([begin, end]))[0]]) if near else None
        return both is not None and _alike(*both) >= CLEAR

    for peak in peaks[peaks > run[-1]]:
        if not like(run[-1], peak):
            break
        run = np.append(run, peak)
    for peak in peaks[peaks < run[0]][::-1]:
        if not like(peak, run[0]):
            break
        run = np.append(peak, run)
    return run


def _alike(a: Floats, b: Floats) -> float:
    """Correlation of two courses of all angles, each angle about its own mean."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    scale = np.sqrt((a**2).sum() * (b**2).sum())
    return float((a * b).sum() / scale) if scale > 0.0 else 0.0


def _regular(peaks: Floats, period: float) -> Floats:
    """The longest run of peaks at about the period."""
    best = run = peaks[:1]
    for peak in peaks[1:]:
        near = abs((peak - run[-1]) / period - 1.0) <= UNEVEN
        run = np.append(run, peak) if near else np.array([peak])
        best = run if len(run) > len(best) else best
    return best


def _vertex(course: Floats, peak: int) -> float:
    """Place of the maximum between samples, by the parabola through three of them."""
    if not 0 < peak < len(course) - 1:
        return float(peak)
    before, at, after = course[peak - 1 : peak + 2]
    bend = before - 2.0 * at + after
    return peak + 0.5 * float(before - after) / float(bend) if bend < 0.0 else float(peak)
