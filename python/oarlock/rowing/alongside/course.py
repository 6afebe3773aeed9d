"""Speed, rate, heart rate and power over a piece, from strokes or from points in time, and its parts as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        is_strokes: whether a row is a stroke.
    """

    time_s: Floats
    distance_m: Floats
    interval: Floats
    values: Mapping[str, Floats]
    is_strokes: bool


@dataclass(frozen=True)
class Part:
    """A part of a piece: its name, strokes, time, distance, and the means of the quantities."""

    name: str
    strokes: int
    duration_s: float
    distance_m: float
    means: Mapping[str, float]


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
    return Course(time_s, distance, np.nan_to_num(interval, nan=1.0), values, is_strokes)


def parts_of(course: Course) -> list[Part]:
    """The intervals of a piece; else every 500 m; else five parts equal in time."""
    known = np.isfinite(course.time_s)
    if not known.any():
        return []
    names, labels = _labels(course, known)
    return [
        _part(course, name, known & (labels == k))
        for k, name in enumerate(names)
        if (known & (labels == k)).any()
    ]


def _labels(course: Course, known: NDArray[np.bool_]) -> tuple[list[str], NDArray[np.int64]]:
    intervals = list(dict.fromkeys(course.interval[known].tolist()))
    if len(intervals) > 1:
        places = {value: k for k, value in enumerate(intervals)}
        return [f"interval {k + 1}" for k in range(len(intervals))], np.array(
            [places.get(value, -1) for value in course.interval.tolist()]
        )
    rowed = course.distance_m - np.nanmin(course.distance_m) if np.isfinite(course.distance_m).any() else None
    if rowed is not None and np.nanmax(rowed) >= _FEWEST_SPLITS * _SPLIT_M:
        labels = np.nan_to_num(np.maximum(rowed - 1e-9, 0.0) // _SPLIT_M, nan=-1.0).astype(np.int64)
        return [f"{(k + 1) * _SPLIT_M:.0f} m" for k in range(int(labels.max()) + 1)], labels
    first, last = float(course.time_s[known].min()), float(course.time_s[known].max())
    share = (course.time_s - first) / max(last - first, 1e-9)
    labels = np.clip(np.nan_to_num(share, nan=-1.0) * _PARTS, -1, _PARTS - 1).astype(np.int64)
    return [f"fifth {k + 1}" for k in range(_PARTS)], labels


def _part(course: Course, name: str, inside: NDArray[np.bool_]) -> Part:
    means = {key: _mean(values[inside]) for key, values in course.values.items()}
    places = np.flatnonzero(inside)
    before = max(places[0] - 1, 0)
    duration_s = float(course.time_s[places[-1]] - course.time_s[before])
    distance_m = float(course.distance_m[places[-1]] - course.distance_m[before])
    return Part(name, int(inside.sum()) if course.is_strokes else 0, duration_s, distance_m, means)


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


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
