"""Writes strokes as RowingData CSV, for rowingdata and sites that take it."""

from __future__ import annotations

import csv
import io
from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.rowing.strokes.table import StrokeTable, running
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

_POUND_FORCE_N = 4.4482216152605
_DEGREE_RAD = np.pi / 180.0
_PLACES = 6
_LARGEST = 1e12
# Names as the format spells them, with its blanks; column of the table; a number times this is in the file's unit.
_WRITTEN = (
    (" lapIdx", "interval", 1.0),
    (" Cadence (stokes/min)", "rate_per_min", 1.0),
    (" HRCur (bpm)", "heart_rate_per_min", 1.0),
    (" Power (watts)", "power_w", 1.0),
    (" StrokeDistance (meters)", "distance_per_stroke_m", 1.0),
    (" DriveLength (meters)", "handle_travel_m", 1.0),
    (" DriveTime (ms)", "drive_time_s", 1e3),
    (" StrokeRecoveryTime (ms)", "recovery_time_s", 1e3),
    (" AverageDriveForce (lbs)", "mean_force_n", 1.0 / _POUND_FORCE_N),
    (" PeakDriveForce (lbs)", "peak_force_n", 1.0 / _POUND_FORCE_N),
    (" AverageDriveForce (N)", "mean_force_n", 1.0),
    (" PeakDriveForce (N)", "peak_force_n", 1.0),
    (" WorkPerStroke (joules)", "work_j", 1.0),
    (" DragFactor", "drag_factor", 1.0),
    ("catch", "catch_angle_rad", 1.0 / _DEGREE_RAD),
    ("finish", "finish_angle_rad", 1.0 / _DEGREE_RAD),
    ("slip", "slip_rad", 1.0 / _DEGREE_RAD),
    ("wash", "wash_rad", 1.0 / _DEGREE_RAD),
    ("peakforceangle", "peak_force_angle_rad", 1.0 / _DEGREE_RAD),
)
_ZERO_FILLED = {name for name, _, _ in _WRITTEN[:10]}
"""Columns that readers of the format need; a number that is missing is 0 in them, as the format writes it."""


def save_rowingdata(table: StrokeTable, path: str | PathLike[str]) -> tuple[str, ...]:
    """Write the strokes as RowingData CSV: one row a stroke, at its end.

    The format has no place for standard deviations, nor for most of Oarlock's columns; `save_fit` and `save_strokes`
    write them. Without a known `epoch` times count from 0, which readers of the format take as times of a day that they
    ask for.

    Returns:
        What was left out, a sentence each.

    Raises:
        DataError: no stroke has a time.
    """
    clock_s = table.clock_s
    kept = np.flatnonzero(np.abs(clock_s) <= _LARGEST)
    if not len(kept):
        raise DataError(f"{path}: no stroke has a time, so there is nothing to write as RowingData CSV")
    start = moment_of(table.epoch)
    begin_s = start.seconds if start is not None and start.kind == "utc" else 0.0
    columns = {
        "TimeStamp (sec)": begin_s + clock_s,
        " ElapsedTime (sec)": clock_s,
        " Stroke Number": np.cumsum(np.isfinite(clock_s)).astype(np.float64),
        " Horizontal (meters)": _distance_m(table),
        " Stroke500mPace (sec/500m)": _pace_s(table),
    }
    empty = np.full(len(table), np.nan)
    for name, column, scale in _WRITTEN:
        if column in table or name in _ZERO_FILLED:
            values = table.columns.get(column, empty) * scale
            columns[name] = np.nan_to_num(values) if name in _ZERO_FILLED else values
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["index", *columns])
    for row, stroke in enumerate(kept):
        writer.writerow([row, *(_cell(values[stroke]) for values in columns.values())])
    write_file(Path(path), text.getvalue())
    lost = len(table) - len(kept)
    notes = [f"{lost} strokes without a time are not in the RowingData file"] if lost else []
    if not begin_s:
        notes.append("times in the RowingData file count from 0: the strokes do not say when they were rowed")
    return tuple(notes)


def _distance_m(table: StrokeTable) -> Floats:
    found = table["distance_m"] if "distance_m" in table else np.zeros(len(table))
    return np.nan_to_num(running(found))


def _pace_s(table: StrokeTable) -> Floats:
    speed = table["speed_m_s"] if "speed_m_s" in table else np.zeros(len(table))
    return np.divide(500.0, speed, out=np.zeros(len(speed)), where=speed > 0.0)


def _cell(value: float) -> str:
    return "" if not abs(value) <= _LARGEST else f"{value:.{_PLACES}f}".rstrip("0").rstrip(".")
