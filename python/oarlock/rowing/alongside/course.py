"""Speed, rate, heart rate and power over a piece, from strokes or from points in time, and its parts as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.alongside.counted import counted_strokes
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.strokes.table import Floats, StrokeTable, running

QUANTITIES = (
    "speed_m_s",
    "rate_per_min",
    "heart_rate_per_min",
    "power_w",
    "peak_force_n",
    "curve_peak_force_n",
)
_SPLIT_M = 500.0
_FEWEST_SPLITS = 3
_PARTS = 5


@dataclass(frozen=True, eq=False)
class Course:
    """Numbers over time: (N,) each, NaN where they are missing.

    Attributes:
        time_s: on one clock.
        distance_m: from the first row.
        interval: which interval of the piece, from 1; all 1 if the file has none.
        values: by the names of `QUANTITIES`; only what is known of some rows.
        counted: (N,) which rows are rowing, not paddling or misread strokes.
        is_strokes: whether a row is a stroke.
    """

    time_s: Floats
    distance_m: Floats
    interval: Floats
    values: Mapping[str, Floats]
    counted: NDArray[np.bool_]
    is_strokes: bool


@dataclass(frozen=True)
class Part:
    """A part of a piece: its name, strokes, time, distance, and the medians of the quantities."""

    name: str
    strokes: int
    duration_s: float
    distance_m: float
    medians: Mapping[str, float]


def course_of(found: StrokeTable | Activity) -> Course:
    """The course of an export; the clock and the distance go on where they restart."""
    is_strokes = isinstance(found, StrokeTable)
    time_s = found.clock_s if isinstance(found, StrokeTable) else found["time_s"]
    count = len(time_s)
    values = {
        name: found[name] for name in QUANTITIES if name in found and bool(np.isfinite(found[name]).any())
    }
    if "peak_force_n" in values:
        values.pop("curve_peak_force_n", None)
    distance = running(found["distance_m"]) if "distance_m" in found else np.full(count, np.nan)
    interval = found["interval"] if "interval" in found else np.ones(count)
    counted = counted_strokes(found) if isinstance(found, StrokeTable) else np.ones(count, dtype=bool)
    return Course(time_s, distance, np.nan_to_num(interval, nan=1.0), values, counted, is_strokes)


def parts_of(course: Course) -> list[Part]:
    """The intervals of a piece; else every 500 m; else five parts equal in time."""
    known = np.isfinite(course.time_s)
    if known.sum() < 2:
        return []
    intervals = list(dict.fromkeys(course.interval[known].tolist()))
    if len(intervals) > 1:
        inside = [known & (course.interval == value) for value in intervals]
        return [_between(course, f"interval {k + 1}", part) for k, part in enumerate(inside)]
    rowed = course.distance_m - np.nanmin(course.distance_m) if np.isfinite(course.distance_m).any() else None
    if rowed is not None and np.nanmax(rowed) >= _FEWEST_SPLITS * _SPLIT_M:
        return _splits(course, rowed)
    ends_s = np.linspace(*_ends(course.time_s[known]), _PARTS + 1)
    inside = [
        known & (course.time_s >= begin_s) & (course.time_s <= end_s) for begin_s, end_s in pairwise(ends_s)
    ]
    return [_between(course, f"fifth {k + 1}", part) for k, part in enumerate(inside) if part.sum() > 1]


def _splits(course: Course, rowed_m: Floats) -> list[Part]:
    """Every 500 m; the time at a mark is interpolated between rows."""
    good = np.isfinite(rowed_m) & np.isfinite(course.time_s)
    ahead_m = np.maximum.accumulate(rowed_m[good])
    last_m = float(ahead_m[-1])
    marks_m = [*np.arange(0.0, last_m, _SPLIT_M).tolist(), last_m]
    at_s = np.interp(marks_m, ahead_m, course.time_s[good])
    return [
        Part(
            f"to {end_m:.0f} m",
            int(((rowed_m > begin_m) & (rowed_m <= end_m)).sum()) if course.is_strokes else 0,
            float(at_s[k + 1] - at_s[k]),
            end_m - begin_m,
            _medians(course, (rowed_m > begin_m) & (rowed_m <= end_m)),
        )
        for k, (begin_m, end_m) in enumerate(pairwise(marks_m))
        if end_m - begin_m > 1.0
    ]


def _between(course: Course, name: str, inside: NDArray[np.bool_]) -> Part:
    """Rows that belong together."""
    first_s, last_s = _ends(course.time_s[inside])
    first_m, last_m = _ends(course.distance_m[inside])
    strokes = int(inside.sum()) if course.is_strokes else 0
    return Part(name, strokes, last_s - first_s, last_m - first_m, _medians(course, inside))


def _ends(values: Floats) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (float("nan"), float("nan"))


def _medians(course: Course, inside: NDArray[np.bool_]) -> dict[str, float]:
    rows = inside & course.counted
    return {key: _median(values[rows]) for key, values in course.values.items()}


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def pace_text(speed_m_s: float) -> str:
    """Time for 500 m, such as 2:03.4; a dash if the boat stands or the speed is not known."""
    if not np.isfinite(speed_m_s) or speed_m_s < 0.5:
        return "–"
    tenths = round(5000.0 / speed_m_s)
    return f"{tenths // 600}:{tenths % 600 / 10:04.1f}"


def clock_text(duration_s: float) -> str:
    """A duration such as 7:05 or 1:02:03; a dash if it is not known."""
    if not np.isfinite(duration_s):
        return "–"
    seconds = round(duration_s)
    hours, rest = divmod(seconds, 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
