"""Reads CSV files of RP3 and RowPerfect: force over handle travel as a list of points in one cell."""

from __future__ import annotations

import numpy as np

from oarlock.rowing.exports.build import ColumnMap, TableBuilder, left_out_note, many
from oarlock.rowing.exports.cells import listed
from oarlock.rowing.exports.grid import CellGrid
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats

TITLE = "RP3 or RowPerfect, strokes (CSV)"
MARKS = ("workout_interval_id", "stroke_number", "stroke_length", "peak_force_pos", "curve_data")

POINT_M = 0.022
"""Handle travel from one point of `curve_data` to the next."""
_PADDING = -32768.0
_CM = 0.01

_WANTED = (
    ColumnMap("time_s", ("time",)),
    ColumnMap("interval", ("workout_interval_id",)),
    ColumnMap("stroke_number", ("stroke_number",)),
    ColumnMap("distance_m", ("distance",)),
    ColumnMap("distance_per_stroke_m", ("distance_per_stroke",), _CM),
    ColumnMap("heart_rate_per_min", ("pulse",), zero_is_missing=True),
)
_OF_THE_STROKE = (
    ColumnMap("rate_per_min", ("stroke_rate",)),
    ColumnMap("drive_time_s", ("drive_time",)),
    ColumnMap("recovery_before_s", ("recover_time",)),
    ColumnMap("handle_travel_m", ("stroke_length",), _CM),
    ColumnMap("peak_force_n", ("peak_force",)),
    ColumnMap("peak_force_position_m", ("peak_force_pos",), _CM),
    ColumnMap("work_j", ("energy_per_stroke",)),
    ColumnMap("power_w", ("power",)),
)
ONSET = "the row's time stamp, taken at the end of the drive, less the drive time: the machine's begin of the drive"
_END = "the row that closes an interval: length, force and times are 0 in the file"


def read(grid: CellGrid, header: int) -> StrokeTable:
    """A file of RP3 or RowPerfect.

    A row is stamped at the end of its drive, and its `recover_time` is the recovery before that drive: both times sum
    to the time since the row before. So `recovery_time_s`, which here follows the drive, comes from the next row.
    """
    rows = grid.rows(header)
    gathered = TableBuilder(rows, onset=ONSET)
    gathered.read((*_WANTED, *_OF_THE_STROKE))
    gathered.number_from_one("interval")
    closing = (gathered.values("handle_travel_m") == 0.0) & (gathered.values("rate_per_min") == 0.0)
    for name in (wanted.name for wanted in _OF_THE_STROKE):
        if name in gathered.columns:
            gathered.columns[name] = gathered.columns[name].but(closing, _END)
    if closing.any():
        gathered.notes.append(
            f"{many(closing.sum(), 'row')} without a stroke of their own, where intervals close"
        )
    _add_curves(gathered)
    _add_times(gathered)
    gathered.notes += left_out_note(_counted(gathered), rows.lines)
    gathered.notes.append("power and work are the machine's own, which its force times travel does not give")
    return gathered.table(TITLE)


def _counted(gathered: TableBuilder) -> Floats:
    """The count of strokes over all intervals, so that a new interval is no gap."""
    number, interval = gathered.values("stroke_number"), gathered.values("interval")
    new = np.diff(interval, prepend=interval[:1]) != 0.0
    base = np.where(new, np.append(0.0, number[:-1]) + 1.0 - number, 0.0)
    total: Floats = number + np.cumsum(np.nan_to_num(base))
    return total


def _add_curves(gathered: TableBuilder) -> None:
    rows, place = gathered.rows, gathered.rows.place("curve_data")
    if place is None:
        return
    points = []
    for force in (listed(rows, place, row) for row in range(len(rows))):
        # up to the last point that was measured; one that is missing before it is NaN
        measured = np.flatnonzero(force > _PADDING)
        curve = force[: measured[-1] + 1] if len(measured) else force[:0]
        points.append(np.where(curve > _PADDING, curve, np.nan))
    if not any(len(force) for force in points):
        gathered.notes.append("no curves: the column curve_data is empty")
        return
    gathered.curves["handle_force_n"] = tuple(
        np.column_stack([POINT_M * np.arange(1, len(force) + 1), force]) for force in points
    )
    reason = "no whole curve in the file"
    for name, of in (
        ("curve_handle_travel_m", lambda force: POINT_M * len(force)),
        ("curve_peak_force_n", lambda force: force.max()),
        ("curve_peak_force_position_m", lambda force: POINT_M * (1 + force.argmax())),
        ("curve_work_j", lambda force: POINT_M * force.sum()),
    ):
        values = np.array(
            [float(of(force)) if len(force) and np.isfinite(force).all() else np.nan for force in points]
        )
        gathered.derive(name, values, reason)


def _add_times(gathered: TableBuilder) -> None:
    """Catch, finish and next catch on the interval's clock; recovery after the drive."""
    end_s, drive_s = gathered.values("time_s"), gathered.values("drive_time_s")
    interval, before_s = gathered.values("interval"), gathered.values("recovery_before_s")
    goes_on = np.append(np.diff(interval) == 0.0, False)
    catch_s = end_s - drive_s
    next_catch_s = np.where(goes_on, np.append(catch_s[1:], np.nan), np.nan)
    after_s = np.where(goes_on, np.append(before_s[1:], np.nan), np.nan)
    last = "no stroke follows in this interval"
    gathered.derive("catch_time_s", catch_s, _END)
    gathered.derive("finish_time_s", np.where(np.isfinite(drive_s), end_s, np.nan), _END)
    gathered.derive("end_time_s", next_catch_s, last)
    gathered.derive("recovery_time_s", after_s, last)
