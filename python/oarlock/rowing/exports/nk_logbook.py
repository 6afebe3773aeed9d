"""Reads strokes of NK Logbook CSV files, with the columns of an EmPower oarlock."""

from __future__ import annotations

import numpy as np

from oarlock.rowing.exports.build import ColumnMap, TableBuilder, left_out_note, many, twice_note
from oarlock.rowing.exports.cells import DEGREE_RAD, is_missing
from oarlock.rowing.exports.grid import CellGrid, TableRows
from oarlock.rowing.exports.nk_speedcoach import add_arcs, told_angles
from oarlock.rowing.strokes.table import StrokeTable

TITLE = "NK Logbook, strokes (CSV)"
MARKS = ("sessionIntervalId", "elapsedTime", "strokeCount", "gpsInstaSpeed")

_MS = 1e-3
_WANTED = (
    ColumnMap("time_s", ("elapsedTime",), _MS),
    ColumnMap("interval", ("sessionIntervalId",)),
    ColumnMap("stroke_number", ("strokeCount",)),
    ColumnMap("distance_m", ("gpsTotalDistance",)),
    ColumnMap("impeller_distance_m", ("impellerTotalDistance",), zero_is_missing=True),
    ColumnMap("speed_m_s", ("gpsInstaSpeed",)),
    ColumnMap("impeller_speed_m_s", ("impellerInstaSpeed",), zero_is_missing=True),
    ColumnMap("distance_per_stroke_m", ("gpsDistStroke",)),
    ColumnMap("rate_per_min", ("strokeRate",)),
    ColumnMap("heart_rate_per_min", ("heartRate",), zero_is_missing=True),
    ColumnMap("duration_s", ("cycleTime",), _MS),
    ColumnMap("drive_time_s", ("driveTime",), _MS),
    ColumnMap("catch_angle_rad", ("catchAngle",), DEGREE_RAD),
    ColumnMap("finish_angle_rad", ("finishAngle",), DEGREE_RAD),
    ColumnMap("slip_rad", ("slip",), DEGREE_RAD),
    ColumnMap("wash_rad", ("wash",), DEGREE_RAD),
    ColumnMap("peak_force_n", ("maxHandleForce",)),
    ColumnMap("mean_force_n", ("handleForceAvg",)),
    ColumnMap("peak_force_angle_rad", ("positionOfMaxForce",), DEGREE_RAD),
    ColumnMap("work_j", ("realWorkPerStroke",)),
    ColumnMap("power_w", ("power",)),
)
_STROKE = {"0", "0.0"}


def read(grid: CellGrid, header: int) -> StrokeTable:
    """A file of the NK Logbook: rows of type 0 are strokes, in order of time; others mark distances, times and laps."""
    rows = grid.rows(header)
    strokes, notes = _strokes(rows)
    gathered = TableBuilder(strokes, notes=notes)
    gathered.read(_WANTED)
    gathered.number_from_one("interval")
    if "catch_angle_rad" in gathered.columns:
        told_angles(gathered)
        add_arcs(gathered)
        drive_s, lasted_s = gathered.values("drive_time_s"), gathered.values("duration_s")
        share = np.divide(drive_s, lasted_s, out=np.full(len(drive_s), np.nan), where=lasted_s > 0.0)
        gathered.derive("recovery_time_s", lasted_s - drive_s, "the oarlock did not tell")
        gathered.derive("rhythm", share, "the oarlock did not tell")
    number = gathered.values("stroke_number")
    gathered.notes += left_out_note(number, strokes.lines) + twice_note(number, strokes.lines)
    return gathered.table(TITLE)


def _strokes(rows: TableRows) -> tuple[TableRows, list[str]]:
    notes = []
    kind, clock = rows.place("type"), rows.place("elapsedTime")
    kept = list(range(len(rows)))
    if kind is not None:
        kept = [row for row in kept if rows.cells[row][kind] in _STROKE or is_missing(rows.cells[row][kind])]
        if len(kept) < len(rows):
            notes.append(
                f"{many(len(rows) - len(kept), 'row')} of other types than 0 mark distance, time or laps, no strokes"
            )
    if clock is not None:
        ordered = sorted(kept, key=lambda row: _sortable(rows.cells[row][clock]))
        if ordered != kept:
            notes.append("the rows were not in order of time; they are now")
        kept = ordered
    return rows.chosen(kept), notes


def _sortable(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return float("inf")  # told apart when the column is read
    return value if value == value else float("inf")
