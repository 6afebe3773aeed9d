"""Reads RowingData CSV, the format of rowsandall.com, rowingdata, Painsled and Open Rowing Monitor."""

from __future__ import annotations

import numpy as np

from oarlock.rowing.exports.activity import Activity, known_columns
from oarlock.rowing.exports.build import ColumnMap, TableBuilder, left_out_note
from oarlock.rowing.exports.cells import DEGREE_RAD, POUND_FORCE_N, Cells
from oarlock.rowing.exports.grid import CellGrid, TableRows
from oarlock.rowing.exports.nk_speedcoach import add_arcs, told_angles
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import FIRST_S

TITLE = "RowingData CSV, strokes (rowsandall and others)"
STAMP, RATE = "TimeStamp (sec)", "Cadence (stokes/min)"
MARKS = (STAMP, RATE)
"""The spelling is the format's own, and so are blanks before names, which do not matter here."""

SIDED = (
    ("catch_angle_rad", "catch"),
    ("finish_angle_rad", "finish"),
    ("slip_rad", "slip"),
    ("wash_rad", "wash"),
    ("peak_force_angle_rad", "peakforceangle"),
)
SIDES = {"": "", "r_": "_port", "l_": "_starboard"}
_MS = 1e-3
_FROM_ONE_ROW = {"time_s", "distance_m", "interval"}
# The first header that a file has gives the column; forces exist in both units.
_WANTED = (
    ColumnMap("time_s", (STAMP,)),
    ColumnMap("interval", ("lapIdx",)),
    ColumnMap("stroke_number", ("Stroke Number",), zero_is_missing=True),
    ColumnMap("distance_m", ("Horizontal (meters)", "cum_dist", "DistanceMeters")),
    ColumnMap("rate_per_min", (RATE,), zero_is_missing=True),
    ColumnMap("heart_rate_per_min", ("HRCur (bpm)",), zero_is_missing=True),
    ColumnMap("power_w", ("Power (watts)",), zero_is_missing=True),
    ColumnMap("distance_per_stroke_m", ("StrokeDistance (meters)",), zero_is_missing=True),
    ColumnMap("drive_time_s", ("DriveTime (ms)",), _MS, zero_is_missing=True),
    ColumnMap("recovery_time_s", ("StrokeRecoveryTime (ms)",), _MS, zero_is_missing=True),
    ColumnMap("handle_travel_m", ("DriveLength (meters)",), zero_is_missing=True),
    ColumnMap("peak_force_n", ("PeakDriveForce (lbs)",), POUND_FORCE_N, zero_is_missing=True),
    ColumnMap("peak_force_n", ("PeakDriveForce (N)",), zero_is_missing=True),
    ColumnMap("mean_force_n", ("AverageDriveForce (lbs)",), POUND_FORCE_N, zero_is_missing=True),
    ColumnMap("mean_force_n", ("AverageDriveForce (N)",), zero_is_missing=True),
    ColumnMap("work_j", ("WorkPerStroke (joules)",), zero_is_missing=True),
    ColumnMap("drag_factor", ("DragFactor",), zero_is_missing=True),
    *(
        ColumnMap(
            f"{side}{name}", (f"{header}{end}",), DEGREE_RAD, zero_is_missing=header not in ("slip", "wash")
        )
        for side, end in SIDES.items()
        for name, header in SIDED
    ),
)
_LOWEST, _HIGHEST = 0.75, 1.5
"""Strokes from one row to the next, by time and rate, in the median: outside of these, rows are no strokes."""


def read(grid: CellGrid, header: int) -> StrokeTable | Activity:
    """A file of strokes, or an activity if its rows are points in time, as those from watches are."""
    rows = grid.rows(header)
    gathered = TableBuilder(rows)
    gathered.read(_WANTED)
    _add_speed(gathered)
    _begin_at_zero(gathered)
    if not _are_strokes(gathered):
        merged = _merged(rows, gathered)
        if merged is None:
            names = ("time_s", "distance_m", "speed_m_s", "heart_rate_per_min", "rate_per_min", "power_w")
            columns = known_columns({name: gathered.values(name) for name in names})
            return Activity(columns, f"{rows.file.name}: RowingData CSV, points in time")
        gathered = merged
    gathered.number_from_one("interval")
    for side in SIDES:
        _leave_out_unmeasured(gathered, side)
    if "catch_angle_rad" in gathered.columns:
        told_angles(gathered)
        add_arcs(gathered)
    elif "finish_angle_rad" in gathered.columns:
        # as in files made from those of Quiske pods, with catches of 0
        gathered.columns["arc_rad"] = gathered.columns.pop("finish_angle_rad")
        gathered.notes.append("no catch angles, so that finish is taken as the arc")
    gathered.notes += left_out_note(gathered.values("stroke_number"), gathered.rows.lines)
    return gathered.table(TITLE)


def _add_speed(gathered: TableBuilder) -> None:
    pace = TableBuilder(gathered.rows)
    pace.read([ColumnMap("pace_s", ("Stroke500mPace (sec/500m)",))])
    seconds = pace.values("pace_s")
    speed = np.divide(500.0, seconds, out=np.full(len(seconds), np.nan), where=seconds > 0.0)
    gathered.derive("speed_m_s", speed, "the pace is 0 or missing in the file")


def _begin_at_zero(gathered: TableBuilder) -> None:
    """Unix times count from the first of them."""
    if "time_s" not in gathered.columns:
        return
    stamps = gathered.columns["time_s"]
    first_s = float(np.nanmin(stamps.values))
    if first_s >= FIRST_S:
        gathered.columns["time_s"] = Cells(stamps.values - first_s, stamps.reasons)


def follow_by_strokes(time_s: Floats, rate_per_min: Floats) -> bool:
    """Whether rows (N,) follow each other by about one stroke; also if nothing says so."""
    step_s, rate = np.diff(time_s), rate_per_min[1:]
    strokes = (step_s * rate / 60.0)[(step_s > 0.0) & np.isfinite(rate)]
    return not len(strokes) or bool(_LOWEST <= np.median(strokes) <= _HIGHEST)


def _are_strokes(gathered: TableBuilder) -> bool:
    return follow_by_strokes(gathered.values("time_s"), gathered.values("rate_per_min"))


def _merged(rows: TableRows, gathered: TableBuilder) -> TableBuilder | None:
    """The strokes of rows in time with a count of strokes; None without a count that comes to every stroke."""
    number = gathered.values("stroke_number")
    known = np.flatnonzero(np.isfinite(number))
    steps = np.diff(number[known])
    if not len(steps) or not (steps == 1.0).any() or np.median(steps[steps != 0.0]) != 1.0:
        return None
    last = known[np.append(steps != 0.0, True)]
    first = known[np.append(True, steps != 0.0)]
    found = TableBuilder(rows.chosen(last.tolist()))
    for name, column in gathered.columns.items():
        places = first if name in _FROM_ONE_ROW else last
        reasons = tuple(column.reasons[place] for place in places)
        found.columns[name] = Cells(column.values[places], reasons)
    found.notes = [
        *gathered.notes,
        f"{len(rows)} rows in time contain {len(last)} strokes; time is that of the first row, other numbers of the "
        "last",
    ]
    return found if _are_strokes(found) else None


def _leave_out_unmeasured(gathered: TableBuilder, side: str) -> None:
    """Slip and wash of 0 are not measured where the catch is not."""
    catch: Floats = gathered.values(f"{side}catch_angle_rad")
    for name in (f"{side}slip_rad", f"{side}wash_rad"):
        if name not in gathered.columns:
            continue
        column = gathered.columns[name]
        column = column.but((column.values == 0.0) & np.isnan(catch), "0 in the file: not measured")
        gathered.columns[name] = column
        if column.is_empty:
            del gathered.columns[name]
