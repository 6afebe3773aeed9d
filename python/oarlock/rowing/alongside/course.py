"""Speed, rate, heart rate and power over a piece, from strokes or from points in time, and its parts for tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from oarlock.rowing.alongside.piece_start import PieceStart, start_of
from oarlock.rowing.alongside.stretches import ContinuousPiece, RowTimeline, reasons_left_out, stretches_of
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.strokes.table import StrokeTable, running
from oarlock.storage.arrays import Bools, Floats

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
_REST_M = 50.0
"""A rest behind the last mark that is shorter belongs to the last split: its pace would be noise."""
_PARTS = 5
_MOST_HAVE_SPEED = 0.5
"""Where fewer rows have a speed, it is that from row to row: some monitors give a single one."""
_ALONE = "outside of the pieces: fewer than 6 strokes together, or without way"


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """Numbers over time: (N,) each, NaN where they are missing.

    Attributes:
        clock: time, distance and interval of each row.
        values: by the names of `QUANTITIES`; only what is known of some rows.
        counted: (N,) which rows are rowing, in a piece, starts included.
        left_out: how many rows are not, by reason.
        stretches: the pieces that were rowed without a pause; empty without times.
        is_strokes: whether a row is a stroke.
        through_water: whether speed and distance are those of an impeller.
    """

    clock: RowTimeline
    values: Mapping[str, Floats]
    counted: Bools
    left_out: Mapping[str, int]
    stretches: Sequence[ContinuousPiece]
    is_strokes: bool
    through_water: bool

    @property
    def time_s(self) -> Floats:
        """Times on one clock."""
        return self.clock.time_s

    @property
    def duration_s(self) -> float:
        """Time rowed, without pauses; NaN if unknown."""
        return sum(one.duration_s for one in self.stretches) if self.stretches else float("nan")

    @property
    def distance_m(self) -> float:
        """Distance rowed, without pauses; NaN if unknown."""
        return sum(one.distance_m for one in self.stretches) if self.stretches else float("nan")

    @property
    def starts(self) -> list[PieceStart]:
        """The starts of the pieces that have one."""
        return [one.start for one in self.stretches if one.start is not None]

    @property
    def steady(self) -> Bools:
        """(N,) which rows count in pace, averages and comparisons: those that are rowed after the starts."""
        found = self.counted.copy()
        for one in self.starts:
            found[one.rows] = False
        return found

    @property
    def steady_s(self) -> float:
        """Time rowed after the starts; NaN if unknown."""
        return sum(one.steady_s for one in self.stretches) if self.stretches else float("nan")

    @property
    def steady_m(self) -> float:
        """Distance rowed after the starts; NaN if unknown."""
        return sum(one.steady_m for one in self.stretches) if self.stretches else float("nan")

    @property
    def total_s(self) -> float:
        """To the last row, from the first one or where the device began to count; with pauses while its clock ran."""
        return _reach(np.append(self.clock.time_s, [one.begin_s for one in self.stretches]))

    @property
    def total_m(self) -> float:
        """Distance likewise, drifting and paddling included."""
        return _reach(np.append(self.clock.distance_m, [one.begin_m for one in self.stretches]))

    @property
    def longest(self) -> ContinuousPiece | None:
        """The longest piece; None without times."""
        return max(self.stretches, key=lambda one: one.duration_s, default=None)


@dataclass(frozen=True)
class Split:
    """A part of a piece: its name, strokes, time, distance, the medians of the quantities, and the pause before it."""

    name: str
    strokes: int
    duration_s: float
    distance_m: float
    medians: Mapping[str, float]
    pause_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """Distance over time; the median of the device's speed where the distance is not known."""
        known = self.distance_m > 0.0 and self.duration_s > 0.0
        return self.distance_m / self.duration_s if known else self.medians.get("speed_m_s", float("nan"))


def course_of(found: StrokeTable | Activity) -> SpeedProfile:
    """The course of an export; the clock and the distance go on where they restart."""
    is_strokes = isinstance(found, StrokeTable)
    clock, through_water = _clock(found)
    reasons = reasons_left_out(found, clock)
    rowing = np.array([not reason for reason in reasons], dtype=bool)
    stretches = [_started(one, clock, found) for one in stretches_of(clock, rowing)]
    counted = np.any([one.rows for one in stretches], axis=0) if stretches else rowing
    reasons = [_ALONE if rowing[k] and not counted[k] else reason for k, reason in enumerate(reasons)]
    told = [reason for reason in reasons if reason]
    values = {
        name: found[name] for name in QUANTITIES if name in found and bool(np.isfinite(found[name]).any())
    }
    if through_water and "impeller_speed_m_s" in found:
        values["speed_m_s"] = found["impeller_speed_m_s"]
    if "peak_force_n" in values:
        values.pop("curve_peak_force_n", None)
    left_out = {reason: told.count(reason) for reason in dict.fromkeys(told)}
    return SpeedProfile(clock, values, counted, left_out, stretches, is_strokes, through_water)


def _started(one: ContinuousPiece, clock: RowTimeline, found: StrokeTable | Activity) -> ContinuousPiece:
    """The piece with its start. Without a speed the power decides, which grows with the cube of the speed."""
    speed = clock.speed_m_s
    if "power_w" in found and not np.isfinite(speed[one.rows]).any():
        speed = np.cbrt(found["power_w"])
    rows = np.flatnonzero(one.rows)
    begin = (one.begin_s, one.begin_m)
    return replace(one, start=start_of(rows, clock.time_s, clock.distance_m, speed, begin))


def _clock(found: StrokeTable | Activity) -> tuple[RowTimeline, bool]:
    """When and where each row was, and whether an impeller says so."""
    stamp_s = found.stamp_s if isinstance(found, StrokeTable) else found["time_s"]
    count = len(stamp_s)
    unknown = np.full(count, np.nan)

    def column(name: str) -> Floats:
        return found.columns.get(name, unknown)

    through_water = not any(np.isfinite(column(name)).any() for name in ("distance_m", "speed_m_s"))
    kind = "impeller_" if through_water else ""
    time_s = running(stamp_s)
    distance_m = _between(time_s, running(column(f"{kind}distance_m")))
    speed = column(f"{kind}speed_m_s")
    if np.isfinite(speed).mean() < _MOST_HAVE_SPEED:
        speed = _speed_m_s(time_s, distance_m)
    restarts = np.zeros(count, dtype=bool)
    known = np.flatnonzero(np.isfinite(time_s))
    restarts[known[1:]] = np.diff(stamp_s[known]) < 0.0
    return RowTimeline(
        time_s, distance_m, speed, np.nan_to_num(column("interval"), nan=1.0), restarts
    ), through_water


def _between(time_s: Floats, distance_m: Floats) -> Floats:
    """The distance (N,) with gaps filled in between rows that have one."""
    known = np.isfinite(time_s) & np.isfinite(distance_m)
    if not known.any():
        return distance_m
    filled = np.interp(time_s, time_s[known], distance_m[known])
    return np.where(np.isfinite(time_s), filled, np.nan)


def _speed_m_s(time_s: Floats, distance_m: Floats) -> Floats:
    """From row to row (N,), where a device gives only the distance."""
    speed = np.full(len(time_s), np.nan)
    known = np.flatnonzero(np.isfinite(time_s) & np.isfinite(distance_m))
    if len(known) > 1:
        steps_s = np.diff(time_s[known])
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(steps_s > 0.0, np.diff(distance_m[known]) / steps_s, np.nan)
        speed[known] = np.append(found[:1], found)
    return speed


def pieces_of(course: SpeedProfile) -> list[Split]:
    """What was rowed between pauses, after the starts."""
    return [
        _part(course, f"piece {k + 1}", one.steady, one.steady_s, one.steady_m, one.pause_s)
        for k, one in enumerate(course.stretches)
    ]


def starts_of(course: SpeedProfile) -> list[Split]:
    """The starts of the pieces that have one."""
    return [part for one in course.stretches for part in _start_part(course, one)]


def _start_part(course: SpeedProfile, one: ContinuousPiece) -> list[Split]:
    if one.start is None:
        return []
    rows = one.rows & ~one.steady
    took_s, way_m = one.start.end_s - one.begin_s, one.start.end_m - one.begin_m
    return [_part(course, one.start.name, rows, took_s, way_m)]


def splits_of(course: SpeedProfile) -> list[Split]:
    """The longest piece: its start, then 500 m by 500 m, or fifths of its time if it is short or has no distance.

    Marks count from where the piece begins, as in a race: the first 500 m lack the way of the start.
    """
    piece = course.longest
    if piece is None or piece.steady_s <= 0.0:
        return []
    time_s, rows = course.clock.time_s, piece.steady
    far_m = course.clock.distance_m - piece.begin_m
    begin_s, begin_m = piece.after_start[0], piece.after_start[1] - piece.begin_m
    good = rows & np.isfinite(far_m)
    if piece.distance_m >= _FEWEST_SPLITS * _SPLIT_M:
        marks_m = np.arange(_SPLIT_M, piece.distance_m - _REST_M, _SPLIT_M)
        ends_m = np.concatenate([[begin_m], marks_m, [piece.distance_m]])
        ahead_m = np.maximum.accumulate(np.append(begin_m, far_m[good]))
        ends_s = np.interp(ends_m, ahead_m, np.append(begin_s, time_s[good]))
        names = [f"to {end:.0f} m" for end in ends_m[1:]]
    else:
        ends_s = np.linspace(begin_s, piece.end_s, _PARTS + 1)
        known_m = np.append(begin_m, far_m[good]) if good.any() else np.full(1, np.nan)
        ends_m = np.interp(ends_s, np.append(begin_s, time_s[good]), known_m)
        names = [f"fifth {k + 1}" for k in range(_PARTS)]
    ends_s[-1] = piece.end_s
    spans = zip(names, pairwise(ends_s.tolist()), pairwise(ends_m.tolist()), strict=True)
    return _start_part(course, piece) + [
        _part(course, name, _within(rows, time_s, *times_s, k == 0), _apart(times_s), _apart(ways_m))
        for k, (name, times_s, ways_m) in enumerate(spans)
    ]


def _apart(ends: tuple[float, float]) -> float:
    return ends[1] - ends[0]


def _within(rows: Bools, time_s: Floats, begin_s: float, end_s: float, first: bool) -> Bools:
    """Rows (N,) of a part: each row is in one part, that at its begin only in the first."""
    after = time_s >= begin_s if first else time_s > begin_s
    return rows & after & (time_s <= end_s)


def _part(
    course: SpeedProfile,
    name: str,
    rows: Bools,
    duration_s: float,
    distance_m: float,
    pause_s: float = 0.0,
) -> Split:
    strokes = int(rows.sum()) if course.is_strokes else 0
    medians = {key: _median(values[rows]) for key, values in course.values.items()}
    return Split(name, strokes, duration_s, distance_m, medians, pause_s)


def _reach(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.max() - known.min()) if len(known) else float("nan")


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
