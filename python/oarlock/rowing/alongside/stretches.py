"""Which rows of an export are rowing, and the pieces between pauses: waiting, drifting and paddling count nowhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.alongside.piece_start import PieceStart
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats, Indices

RATES_PER_MIN = (14.0, 50.0)
"""Strokes outside are paddling or misread."""
WHOLE = 0.5
"""Strokes with less than this share of the median handle travel or arc are no whole strokes."""
_LENGTHS = ("handle_travel_m", "arc_rad", "curve_arc_rad")
SLOW = 0.5
"""Below this share of the usual speed a boat drifts or its crew paddles."""
PAUSE_S = 2.0 * 60.0 / RATES_PER_MIN[0]
"""Two strokes at the lowest rate: rows of rowing that are further apart have a pause between them."""
FEWEST = 6
"""Fewer strokes between two pauses are no piece, such as those that turn a boat."""
_ON = 0.8
_LONGEST_GAP_S = 30.0
"""A shorter gap with at least this share of the speed before it was rowed: the device missed strokes."""
_BEFORE = 5
_SPARSE = 3.0
"""A pause is also longer than so many usual steps between rows: watches save few points."""


@dataclass(frozen=True, eq=False)
class ContinuousPiece:
    """A piece that was rowed without a pause.

    Attributes:
        rows: (N,) its rows of rowing.
        begin_s, end_s: on the clock of the course.
        begin_m, end_m: on the distance of the course; NaN without one.
        pause_s: how long the pause before it was; NaN if the clock stood still, 0 if there was none.
        start: its first strokes, until it is up to speed; None if it begins at speed.
    """

    rows: Bools
    begin_s: float
    end_s: float
    begin_m: float
    end_m: float
    pause_s: float
    start: PieceStart | None = None

    @property
    def steady(self) -> Bools:
        """(N,) its rows after the start."""
        found = self.rows.copy()
        if self.start is not None:
            found[self.start.rows] = False
        return found

    @property
    def after_start(self) -> tuple[float, float]:
        """Time and distance of the course at which the start ends, or at which the piece begins."""
        return (self.begin_s, self.begin_m) if self.start is None else (self.start.end_s, self.start.end_m)

    @property
    def duration_s(self) -> float:
        """Time rowed, the start included."""
        return self.end_s - self.begin_s

    @property
    def distance_m(self) -> float:
        """Distance rowed, the start included; NaN if unknown."""
        return self.end_m - self.begin_m

    @property
    def steady_s(self) -> float:
        """Time rowed after the start."""
        return self.end_s - self.after_start[0]

    @property
    def steady_m(self) -> float:
        """Distance rowed after the start; NaN if unknown."""
        return self.end_m - self.after_start[1]


@dataclass(frozen=True, eq=False)
class RowTimeline:
    """When and where each row of an export was: (N,) each; NaN where it is missing.

    Attributes:
        time_s: on one clock, which goes on where the device's restarts.
        distance_m: likewise.
        speed_m_s: of the boat, or of the flywheel.
        interval: of the device; all 1 if it has none.
        restarts: rows with which the device's clock begins again.
    """

    time_s: Floats
    distance_m: Floats
    speed_m_s: Floats
    interval: Floats
    restarts: Bools


def reasons_left_out(found: StrokeTable | Activity, clock: RowTimeline) -> list[str]:
    """Why each row (N) is no rowing; "" for rows that are."""
    reasons = np.full(len(clock.time_s), "", dtype=object)

    def leave_out(rows: Bools, why: str) -> None:
        reasons[rows & (reasons == "")] = why

    if np.isfinite(clock.time_s).any():
        leave_out(~np.isfinite(clock.time_s), "without a time")
    if isinstance(found, StrokeTable):
        if "rate_per_min" in found:
            rate, (low, high) = found["rate_per_min"], RATES_PER_MIN
            leave_out(~np.isfinite(rate), "without a stroke rate")
            leave_out(
                ~((rate >= low) & (rate <= high)), f"below {low:.0f} or above {high:.0f} strokes a minute"
            )
        for name in _LENGTHS:
            if name in found and np.isfinite(found[name]).any():
                short = found[name] < WHOLE * np.nanmedian(found[name])
                leave_out(short, "shorter than half of the usual stroke")
    slow = _slow(clock, reasons == "")
    leave_out(slow, "slower than half of the usual speed: waiting, drifting or paddling")
    return [str(reason) for reason in reasons]


def _slow(clock: RowTimeline, rowing: Bools) -> Bools:
    """Bools without way, but for those of a start, which lead to a piece with growing speed."""
    order = np.flatnonzero(rowing)
    slow = np.asarray(clock.speed_m_s < SLOW * _usual_m_s(clock, order), dtype=bool)
    for row, after in zip(order[-2::-1], order[:0:-1], strict=True):
        near = clock.time_s[after] - clock.time_s[row] <= PAUSE_S and not clock.restarts[after]
        if slow[row] and not slow[after] and near and clock.speed_m_s[row] < clock.speed_m_s[after]:
            slow[row] = False
    return slow


def stretches_of(clock: RowTimeline, rowing: Bools) -> list[ContinuousPiece]:
    """The pieces between pauses, of the rows (N,) of rowing; none without times."""
    order = np.flatnonzero(rowing & np.isfinite(clock.time_s))
    if len(order) < 2:
        return []
    time_s = clock.time_s[order]
    steps_s = np.diff(time_s)
    pause_s = max(PAUSE_S, _SPARSE * float(np.median(steps_s)))
    run = np.cumsum(clock.restarts)[order]
    paused = (steps_s > pause_s) & ~_rowed_on(clock, order)
    restarted = np.diff(run) > 0
    interval = _whole_intervals(clock.interval[order])
    cuts = np.flatnonzero(paused | restarted | (np.diff(interval) != 0.0)) + 1
    found: list[ContinuousPiece] = []
    for rows in np.split(order, cuts):
        one = _stretch(clock, rows, found[-1] if found else None)
        drifted = one.distance_m < SLOW * _usual_m_s(clock, order) * one.duration_s
        if len(rows) >= FEWEST and not drifted:
            found.append(one)
    return found


def _stretch(clock: RowTimeline, rows: Indices, earlier: ContinuousPiece | None) -> ContinuousPiece:
    inside = np.zeros(len(clock.time_s), dtype=bool)
    inside[rows] = True
    begin_s, begin_m = _begin(clock, int(rows[0]))
    pause_s = 0.0
    if earlier is not None:
        stood = clock.restarts[np.flatnonzero(earlier.rows)[-1] + 1 : rows[0] + 1].any()
        pause_s = float("nan") if stood else begin_s - earlier.end_s
    return ContinuousPiece(
        inside, begin_s, float(clock.time_s[rows[-1]]), begin_m, float(clock.distance_m[rows[-1]]), pause_s
    )


def _rowed_on(clock: RowTimeline, order: Indices) -> Bools:
    """Whether the boat went on between each row of `order` and the next one, as before."""
    steps_s, steps_m = np.diff(clock.time_s[order]), np.diff(clock.distance_m[order])
    speed = clock.speed_m_s[order]
    before = np.array([np.median(speed[max(k + 1 - _BEFORE, 0) : k + 1]) for k in range(len(steps_s))])
    with np.errstate(invalid="ignore"):
        return np.asarray((steps_s < _LONGEST_GAP_S) & (steps_m > _ON * before * steps_s), dtype=bool)


def _usual_m_s(clock: RowTimeline, order: Indices) -> float:
    known = clock.speed_m_s[order]
    known = known[np.isfinite(known) & (known > 0.0)]
    return float(np.median(known)) if len(known) else float("nan")


def _whole_intervals(interval: Floats) -> Floats:
    """Intervals of rows (N,); those with too few rows join the next one."""
    kept = interval.copy()
    values, counts = np.unique(interval, return_counts=True)
    few = np.isin(kept, values[counts < FEWEST])
    for row in np.flatnonzero(few)[::-1]:
        kept[row] = kept[row + 1] if row + 1 < len(kept) else kept[max(row - 1, 0)]
    return kept


def _begin(clock: RowTimeline, row: int) -> tuple[float, float]:
    """Where a piece begins: with its first row, or where the device began to count, if it was rowed from there."""
    time_s, distance_m = float(clock.time_s[row]), float(clock.distance_m[row])
    restarts = np.flatnonzero(clock.restarts[: row + 1])
    earlier = np.flatnonzero(np.isfinite(clock.time_s[: restarts[-1] if len(restarts) else 0]))
    began_s = float(clock.time_s[earlier[-1]]) if len(earlier) else 0.0
    began_m = float(clock.distance_m[earlier[-1]]) if len(earlier) else 0.0
    took_s, way_m = time_s - began_s, distance_m - began_m
    usual_m = _usual_m_s(clock, np.arange(len(clock.time_s))) * took_s
    from_rest = took_s <= PAUSE_S and not way_m > 2.0 * usual_m
    rowed_on = took_s <= _LONGEST_GAP_S and SLOW * usual_m < way_m <= 2.0 * usual_m
    if took_s < 0.0 or not (from_rest or rowed_on):
        return time_s, distance_m
    return began_s, began_m if np.isfinite(distance_m) else distance_m
