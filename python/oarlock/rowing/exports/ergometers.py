"""Maps columns of ergometer and cox-box logs with one row per stroke to ours, for `load_stroke_export`."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oarlock.rowing.exports.build import ColumnMap, TableBuilder, left_out_note, many, twice_note
from oarlock.rowing.exports.cells import POUND_FORCE_N, listed
from oarlock.rowing.exports.grid import CellGrid, TableRows
from oarlock.rowing.strokes.table import StrokeTable

_MS = 1e-3
_CM = 0.01


@dataclass(frozen=True)
class PaceColumn:
    """A column with the time, s or mm:ss, for a distance in m."""

    header: str
    distance_m: float
    is_time: bool = False


@dataclass(frozen=True)
class Log:
    """One kind of log.

    Attributes:
        title: what wrote it.
        marks: names that its header holds.
        wanted: its columns.
        pace: the column with the time for a distance; it gives the speed.
        count: the column that counts strokes, where one stroke fills several rows: a row a second, say.
        until_blank: whether the strokes end at the first blank row.
        forces: a column with the force curve of the drive, numbers in pounds between blanks.
        drive_start: a column with the moment at which each drive began, and one with the moment of 0 s.
        onset: what the device takes as the begin of a drive, if `drive_start` is given.
        stroke_type: a column that says 0 of strokes and other numbers of other events.
        remarks: what the table does not tell by itself.
    """

    title: str
    marks: tuple[str, ...]
    wanted: tuple[ColumnMap, ...]
    pace: PaceColumn | None = None
    count: str = ""
    until_blank: bool = False
    forces: str = ""
    drive_start: tuple[str, str] = ("", "")
    onset: str = ""
    stroke_type: str = ""
    remarks: tuple[str, ...] = ()


def read(log: Log, grid: CellGrid, header: int) -> StrokeTable:
    """A file of this kind."""
    all_rows = grid.rows(header, until_blank=log.until_blank)
    rows, firsts, notes = _strokes(log, all_rows)
    gathered = TableBuilder(rows, notes=notes)
    gathered.read(log.wanted)
    if firsts is not rows:
        begins = TableBuilder(firsts)
        begins.read([wanted for wanted in log.wanted if wanted.name in _OF_THE_BEGIN])
        gathered.columns |= begins.columns
    _add_speed(log, gathered)
    _add_forces(log, gathered)
    _add_drive_times(log, gathered)
    counted = TableBuilder(all_rows)
    counted.read([wanted for wanted in log.wanted if wanted.name == "stroke_number"])
    number = counted.values("stroke_number")
    gathered.notes += left_out_note(number, all_rows.lines)
    gathered.notes += [] if log.count else twice_note(number, all_rows.lines)
    gathered.notes += log.remarks
    return gathered.table(log.title)


def _strokes(log: Log, rows: TableRows) -> tuple[TableRows, TableRows, list[str]]:
    """The last and the first row of each stroke, and notes on all other rows."""
    kind = rows.place(log.stroke_type) if log.stroke_type else None
    if kind is not None:
        kept = rows.chosen(row for row, cells in enumerate(rows.cells) if cells[kind] == "0")
        others = len(rows) - len(kept)
        return kept, kept, [f"{many(others, 'row')} with other events than strokes"] if others else []
    count = rows.place(log.count) if log.count else None
    return (rows, rows, []) if count is None else _first_and_last(rows, count)


def _first_and_last(rows: TableRows, place: int) -> tuple[TableRows, TableRows, list[str]]:
    """Of the rows with the same count the last, which knows most of the stroke, and the first, which knows its time."""
    counts = [cells[place] for cells in rows.cells]
    rowed = [k for k, count in enumerate(counts) if count not in ("", "0")]
    first = [k for k in rowed if k == 0 or counts[k - 1] != counts[k]]
    last = [k for k in rowed if counts[k + 1 : k + 2] != counts[k : k + 1]]
    strokes = many(len(last), "stroke")
    note = f"{len(rows)} rows in time contain {strokes}; time is that of the first row, other numbers of the last"
    return rows.chosen(last), rows.chosen(first), [note]


_OF_THE_BEGIN = ("time_s", "distance_m", "interval")


def _add_speed(log: Log, gathered: TableBuilder) -> None:
    if log.pace is None:
        return
    pace = TableBuilder(gathered.rows)
    pace.read([ColumnMap("pace_s", (log.pace.header,), is_time=log.pace.is_time)])
    seconds = pace.values("pace_s")
    speed = np.divide(log.pace.distance_m, seconds, out=np.full(len(seconds), np.nan), where=seconds > 0.0)
    gathered.derive("speed_m_s", speed, "the pace is 0 or missing in the file")


def _add_forces(log: Log, gathered: TableBuilder) -> None:
    rows, place = gathered.rows, gathered.rows.place(log.forces) if log.forces else None
    if place is None:
        return
    curves = tuple(listed(rows, place, row, " ") * POUND_FORCE_N for row in range(len(rows)))
    if any(len(curve) for curve in curves):
        gathered.curves["handle_force_n"] = curves
        peaks = np.array([curve.max() if len(curve) else np.nan for curve in curves])
        gathered.derive("curve_peak_force_n", peaks, "no curve in the file")


def _add_drive_times(log: Log, gathered: TableBuilder) -> None:
    """Catch, finish and next catch, where the file has the moment of each drive's begin, and its distance."""
    rows, (begin, zero) = gathered.rows, log.drive_start
    begin_place, zero_place = (rows.place(name) if name else None for name in (begin, zero))
    if begin_place is None or zero_place is None or not len(rows):
        return
    moments_s = np.array([_moment_s(cells[begin_place]) for cells in rows.cells])
    catch_s = moments_s - _moment_s(rows.cells[0][zero_place])
    gathered.onset = log.onset
    gathered.derive("catch_time_s", catch_s, "no moment in the file")
    gathered.derive("finish_time_s", catch_s + gathered.values("drive_time_s"), "no moment or no drive time")
    gathered.derive("end_time_s", catch_s + gathered.values("duration_s"), "no moment or no duration")
    # Distances are those of the begin; a row's distance is that of its end.
    end_m = gathered.values("distance_m") + gathered.values("distance_per_stroke_m")
    gathered.derive("distance_m", end_m, "no distance of the stroke")


def _moment_s(text: str) -> float:
    """Seconds since 1970 of a moment such as 2016-03-29T17:42:09.100Z; NaN if it is none."""
    try:
        return datetime.datetime.fromisoformat(text).timestamp()
    except ValueError:
        return float("nan")


LOGS: Mapping[str, Log] = MappingProxyType(
    {
        "ergdata": Log(
            "ErgData of Concept2, strokes (CSV)",
            ("Stroke Number", "Time (seconds)", "Distance (meters)", "Stroke Rate"),
            (
                ColumnMap("time_s", ("Time (seconds)",)),
                ColumnMap("stroke_number", ("Stroke Number",)),
                ColumnMap("distance_m", ("Distance (meters)",)),
                ColumnMap("rate_per_min", ("Stroke Rate",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("Heart Rate",), zero_is_missing=True),
            ),
            pace=PaceColumn("Pace (seconds per 500m", 500.0),
        ),
        "concept2-logbook": Log(
            "Concept2 logbook, strokes of a workout (CSV)",
            ("Number", "Time (seconds)", "Pace (seconds)", "Stroke Rate"),
            (
                ColumnMap("time_s", ("Time (seconds)",)),
                ColumnMap("stroke_number", ("Number",)),
                ColumnMap("distance_m", ("Distance (meters)", "Distance (metres)")),
                ColumnMap("rate_per_min", ("Stroke Rate",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("Heart Rate",), zero_is_missing=True),
                ColumnMap("power_w", ("Watts",), zero_is_missing=True),
            ),
            pace=PaceColumn("Pace (seconds)", 500.0),
        ),
        "painsled": Log(
            "Painsled, strokes (CSV)",
            ("ElapsedTime (sec)", "Cadence (strokes/min)", "StrokeCount", "DriveLength (meters)"),
            (
                ColumnMap("time_s", ("ElapsedTime (sec)",)),
                ColumnMap("interval", ("lapIdx",)),
                ColumnMap("stroke_number", ("StrokeCount",)),
                ColumnMap("distance_m", ("Horizontal (meters)",)),
                ColumnMap("speed_m_s", ("Speed (m/sec)",), zero_is_missing=True),
                ColumnMap("distance_per_stroke_m", ("StrokeDistance (meters)",)),
                ColumnMap("rate_per_min", ("Cadence (strokes/min)",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("HRCur (bpm)",), zero_is_missing=True),
                ColumnMap("drive_time_s", ("DriveTime (ms)",), _MS, zero_is_missing=True),
                ColumnMap("recovery_time_s", ("StrokeRecoveryTime (ms)",), _MS, zero_is_missing=True),
                ColumnMap("handle_travel_m", ("DriveLength (meters)",)),
                ColumnMap("peak_force_n", ("PeakDriveForce (lbs)",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("mean_force_n", ("AverageDriveForce (lbs)",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("work_j", ("WorkPerStroke (joules)",), zero_is_missing=True),
                ColumnMap("power_w", ("Power (watts)",)),
                ColumnMap("drag_factor", ("DragFactor",), zero_is_missing=True),
            ),
        ),
        "painsled-desktop": Log(
            "Painsled for the desktop, strokes with force curves (CSV)",
            ("stroke.driveStartMs", "stroke.strokeNumber", "stroke.driveMs", "stroke.forceMap"),
            (
                ColumnMap("interval", ("stroke.intervalNumber",)),
                ColumnMap("stroke_number", ("stroke.strokeNumber",)),
                ColumnMap("distance_m", ("stroke.startWorkoutMeter",)),
                ColumnMap("distance_per_stroke_m", ("stroke.strokeMeters",)),
                ColumnMap("rate_per_min", ("stroke.strokesPerMin",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("stroke.hrBpm",), zero_is_missing=True),
                ColumnMap("duration_s", ("stroke.strokeTimeMs",), _MS, zero_is_missing=True),
                ColumnMap("drive_time_s", ("stroke.driveMs",), _MS, zero_is_missing=True),
                ColumnMap("recovery_time_s", ("stroke.slideMs",), _MS, zero_is_missing=True),
                ColumnMap("power_w", ("stroke.watts",), zero_is_missing=True),
                ColumnMap("drag_factor", ("stroke.dragFactor",), zero_is_missing=True),
            ),
            pace=PaceColumn("stroke.paceSecPer1k", 1000.0),
            forces="stroke.forceMap",
            drive_start=("stroke.driveStartMs", "workout.rowStartMs"),
            onset="the monitor's begin of the drive: the flywheel accelerates (states of a stroke in Concept2's CSAFE "
            "definition), so it is later than the handle's reversal",
            stroke_type="stroke.strokeType",
            remarks=("the file names no unit of force; a Concept2 monitor gives pounds, which become N",),
        ),
        "smartrow": Log(
            "SmartRow, strokes (CSV)",
            ("Stroke (#)", "Second (#)", "Work (J)", "Stroke rate (SPM)"),
            (
                ColumnMap("time_s", ("Second (#)",)),
                ColumnMap("stroke_number", ("Stroke (#)",)),
                ColumnMap("distance_m", ("Distance (m)",)),
                ColumnMap("rate_per_min", ("Stroke rate (SPM)",)),
                ColumnMap("heart_rate_per_min", ("Heart rate (bpm)",), zero_is_missing=True),
                ColumnMap("work_j", ("Work (J)",)),
                ColumnMap("power_w", ("Actual power (W)",)),
            ),
            pace=PaceColumn("Actual split (s)", 500.0),
        ),
        "hero": Log(
            "Hero, strokes (CSV)",
            ("Stroke #", "Time", "Stroke Rate", "Drive Time", "Recovery Time"),
            (
                ColumnMap("time_s", ("Time",), is_time=True),
                ColumnMap("stroke_number", ("Stroke #",)),
                ColumnMap("distance_m", ("Distance",)),
                ColumnMap("distance_per_stroke_m", ("Distance per Stroke",)),
                ColumnMap("rate_per_min", ("Stroke Rate",)),
                ColumnMap("heart_rate_per_min", ("HR",), zero_is_missing=True),
                ColumnMap("drive_time_s", ("Drive Time",)),
                ColumnMap("recovery_time_s", ("Recovery Time",)),
                ColumnMap("handle_travel_m", ("Stroke Length",), _CM),
                ColumnMap("peak_force_n", ("Peak Drive Force (N)",)),
                ColumnMap("mean_force_n", ("Average Drive Force (N)",)),
                ColumnMap("work_j", ("Work (J)",)),
                ColumnMap("power_w", ("Watts",)),
                ColumnMap("drag_factor", ("Drag Factor",)),
            ),
            pace=PaceColumn("Split", 500.0, is_time=True),
            remarks=("the file names no unit of stroke length; by its size it is cm",),
        ),
        "coxmate": Log(
            "CoxMate, strokes (CSV)",
            ("Stroke", "Time", "Rating", "Ratio", "Cover"),
            (
                ColumnMap("time_s", ("Time",)),
                ColumnMap("stroke_number", ("Stroke",)),
                ColumnMap("distance_m", ("Distance",)),
                ColumnMap("rate_per_min", ("Rating",), zero_is_missing=True),
                ColumnMap("speed_m_s", ("Speed",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("Heart Rate",), zero_is_missing=True),
            ),
            remarks=("Ratio and Cover are not read: nothing says how they are defined",),
        ),
        "ergstick": Log(
            "ErgStick, rows in time (CSV)",
            ("Total elapsed time (s)", "Stroke count", "Drive length (m)", "Stroke recovery time (s)"),
            (
                ColumnMap("time_s", ("Total elapsed time (s)",)),
                ColumnMap("interval", ("Interval count",)),
                ColumnMap("stroke_number", ("Stroke count",)),
                ColumnMap("distance_m", ("Total distance (m)",)),
                ColumnMap("speed_m_s", ("Speed (m/s)",), zero_is_missing=True),
                ColumnMap("distance_per_stroke_m", ("Stroke distance (m)",), zero_is_missing=True),
                ColumnMap("rate_per_min", ("Stroke rate (/min)",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("Current heart rate (bpm)",), zero_is_missing=True),
                ColumnMap("drive_time_s", ("Drive time (s)",), zero_is_missing=True),
                ColumnMap("recovery_time_s", ("Stroke recovery time (s)",), zero_is_missing=True),
                ColumnMap("handle_travel_m", ("Drive length (m)",), zero_is_missing=True),
                ColumnMap("peak_force_n", ("Peak drive force (lbs)",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("mean_force_n", ("Ave. drive force (lbs)",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("power_w", ("Stroke power (W)",), zero_is_missing=True),
                ColumnMap("drag_factor", ("Drag factor",), zero_is_missing=True),
            ),
            count="Stroke count",
            remarks=("Work per stroke (J) is not read: its numbers are a hundredth of power times time",),
        ),
        "boatcoach": Log(
            "BoatCoach on an ergometer, rows in time (CSV)",
            ("workoutType", "strokeRate", "strokeCount", "strokeDriveTime", "strokePeakForce"),
            (
                ColumnMap("time_s", ("workTime",), is_time=True),
                ColumnMap("interval", ("intervalCount",)),
                ColumnMap("stroke_number", ("strokeCount",)),
                ColumnMap("distance_m", ("workDistance",)),
                ColumnMap("rate_per_min", ("strokeRate",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("currentHeartRate",), zero_is_missing=True),
                ColumnMap("drive_time_s", ("strokeDriveTime",), zero_is_missing=True),
                ColumnMap("handle_travel_m", ("strokeLength",), zero_is_missing=True),
                ColumnMap("peak_force_n", ("strokePeakForce",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("mean_force_n", ("strokeAverageForce",), POUND_FORCE_N, zero_is_missing=True),
                ColumnMap("power_w", ("strokePower",), zero_is_missing=True),
                ColumnMap("drag_factor", ("dragFactor",), zero_is_missing=True),
            ),
            pace=PaceColumn("stroke500MPace", 500.0, is_time=True),
            count="strokeCount",
            remarks=("the file names no unit of force; a Concept2 monitor gives pounds, which become N",),
        ),
        "boatcoach-water": Log(
            "BoatCoach on the water, rows in time (CSV)",
            ("Elapsed Time", "Piece Number", "Stroke Rate", "Cumulative Stroke Count"),
            (
                ColumnMap("time_s", ("TOTAL Time Since Start BoatCoach",), is_time=True),
                ColumnMap("interval", ("Piece Number",)),
                ColumnMap("stroke_number", ("Cumulative Stroke Count",)),
                ColumnMap("distance_m", ("Cumulative Distance(m)",)),
                ColumnMap("rate_per_min", ("Stroke Rate",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("Heart Rate",), zero_is_missing=True),
            ),
            pace=PaceColumn("Last 10 Stroke Speed(/500m)", 500.0, is_time=True),
            count="Cumulative Stroke Count",
        ),
        "rowpro": Log(
            "RowPro, strokes (CSV)",
            ("Time", "Distance", "Pace", "Watts", "Cals", "SPM", "HR", "DutyCycle"),
            (
                ColumnMap("time_s", ("Time",), _MS),
                ColumnMap("distance_m", ("Distance",)),
                ColumnMap("rate_per_min", ("SPM",), zero_is_missing=True),
                ColumnMap("heart_rate_per_min", ("HR",), zero_is_missing=True),
                ColumnMap("power_w", ("Watts",)),
            ),
            pace=PaceColumn("Pace", 1.0),
            until_blank=True,
            remarks=("DutyCycle is not read: it is a third in every row",),
        ),
    }
)
