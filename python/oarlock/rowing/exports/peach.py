"""Reads text exports of Peach PowerLine: gate angle, gate force and boat speed at 50 Hz, as strokes of one seat.

The layout is that which two open programs read: matthewghgriffiths/rowing (telemetry.py, peach.py) and RtcNoordApp
(utils.py, profil.py). A line that begins with ``=====`` names a section; that of ``Periodic`` has a row of channels, a
row of seats, then numbers, Time in ms. Angles are in deg, the catch negative; forces in kgf (RtcNoordApp multiplies
them by 9.81; the device's thresholds are in kg). Only these channels are read. The numbers per stroke of the section
``Aperiodic 0x800A`` are not, since nothing documents the instant of their time stamps.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from oarlock import Recording
from oarlock.recording import ScalarStream
from oarlock.rowing.exports.cells import DEGREE_RAD, derived, numbers
from oarlock.rowing.exports.grid import CellGrid, TableRows
from oarlock.rowing.strokes.find_strokes import find_strokes
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

TITLE = "Peach PowerLine, text export"
BEGIN = "====="
KILOGRAM_FORCE_N = 9.80665
ONSET = "the gate's angle reverses: the handle's turn at the catch, found by Oarlock in the 50 Hz angle"
_MS = 1e-3
_SIDES = {"P ": "r_", "S ": "l_", "": ""}
"""Port is the rower's right; a sweep oar has no prefix."""
_NOTE = (
    "strokes are found in the gate's angle; the device's own numbers per stroke are not read, because the instant of "
    "their time stamps is not documented"
)


def is_peach(text: str) -> bool:
    """Whether a text begins with a section of PowerLine."""
    return text.lstrip().startswith(f"{BEGIN}\t")


def read_peach(grid: CellGrid, seat: int | None) -> StrokeTable:
    """The strokes of one seat, with gate angle and gate force as curves over the time since the catch.

    Args:
        grid: the file split at tabs.
        seat: which, from 1 at the bow; None if the file has only one.

    Raises:
        DataError: there is no section Periodic or more than one, no such seat, or no strokes.
    """
    rows, seats = _periodic(grid)
    chosen = _seat(rows, seats, seat)
    time_s = _column(rows, seats, "Time", "", _MS)
    if time_s is None or not (np.diff(time_s) > 0.0).all():
        raise DataError(
            f"{grid.file}: the column Time of the section Periodic is missing or does not increase"
        )
    angles, forces = (
        {
            side: found
            for prefix, side in _SIDES.items()
            if (found := _column(rows, seats, f"{prefix}{name}", chosen, scale)) is not None
        }
        for name, scale in (("GateAngle", DEGREE_RAD), ("GateForceX", KILOGRAM_FORCE_N))
    )
    if not angles:
        raise DataError(f"{grid.file}: seat {chosen} has no GateAngle, so its strokes cannot be found")
    oars = [ScalarStream(f"{side}oar_phi", time_s, angle) for side, angle in angles.items()]
    table = find_strokes(Recording(oars)).table()
    if not len(table):
        raise DataError(f"{grid.file}: {TITLE}, but seat {chosen} has no strokes. {' '.join(table.notes)}")
    boat = {name: _column(rows, seats, name, "Boat") for name in ("Speed", "Distance")}
    return _with_boat(_with_curves(table, time_s, angles, forces), time_s, boat, grid, chosen)


def _periodic(grid: CellGrid) -> tuple[TableRows, list[str]]:
    """The rows of the section Periodic, and the seat of each of their columns."""
    marks = [k for k, row in enumerate(grid.cells) if row and row[0] == BEGIN]
    named = [
        (begin, end)
        for begin, end in pairwise([*marks, len(grid.cells)])
        if any(cell == "Periodic" for cell in grid.cells[begin][1:])
    ]
    if len(named) != 1:
        raise DataError(
            f"{grid.file}: {TITLE}, with {len(named)} sections Periodic, expected 1. Export one piece with periodic "
            "data"
        )
    begin, end = named[0][0] + 1, named[0][1]
    if end - begin < 2:
        raise DataError(f"{grid.file}: its section Periodic is empty")
    part = CellGrid(grid.file, grid.lines[begin:end], grid.cells[begin:end])
    seats = grid.cells[begin + 1]
    return part.rows(0, skipped=1), [*seats, *[""] * len(grid.cells[begin])]


def _seat(rows: TableRows, seats: list[str], seat: int | None) -> str:
    held = sorted(
        {
            seats[k]
            for k, name in enumerate(rows.names)
            if name.removeprefix("P ").removeprefix("S ") == "GateAngle"
        }
    )
    if seat is None and len(held) == 1:
        return held[0]
    if seat is None or str(seat) not in held:
        asked = "" if seat is None else f"; it has no seat {seat}"
        raise DataError(
            f"{rows.file}: is {TITLE} with the seats {', '.join(held) or 'none'}{asked}. Choose one with --seat"
        )
    return str(seat)


def _column(rows: TableRows, seats: list[str], name: str, seat: str, scale: float = 1.0) -> Floats | None:
    for place, own in enumerate(rows.names):
        if own == name and (not seat or seats[place] == seat):
            return numbers(rows, place, scale).values
    return None


def _with_curves(
    table: StrokeTable, time_s: Floats, angles: Mapping[str, Floats], forces: Mapping[str, Floats]
) -> StrokeTable:
    """With the curves from catch to next catch, and the peak of each force."""
    ends_s = np.where(np.isnan(table["end_time_s"]), table["finish_time_s"], table["end_time_s"])
    parts = [
        np.flatnonzero((time_s >= begin_s) & (time_s <= end_s))
        for begin_s, end_s in zip(table["catch_time_s"], ends_s, strict=True)
    ]
    courses = {f"{side}oar_angle_rad": angle for side, angle in angles.items()}
    courses |= {f"{side}gate_force_n": force for side, force in forces.items()}
    curves = {
        name: tuple(
            np.column_stack([time_s[part] - begin_s, course[part]])
            for part, begin_s in zip(parts, table["catch_time_s"], strict=True)
        )
        for name, course in courses.items()
    }
    peaks = {
        f"{side}peak_gate_force_n": np.array([np.nanmax(force[part], initial=-np.inf) for part in parts])
        for side, force in forces.items()
    }
    known = {name: np.where(np.isfinite(peak), peak, np.nan) for name, peak in peaks.items()}
    return StrokeTable({**table.columns, **known}, table.stds, table.reasons, curves, notes=table.notes)


def _with_boat(
    table: StrokeTable, time_s: Floats, boat: Mapping[str, Floats | None], grid: CellGrid, seat: str
) -> StrokeTable:
    """With the boat's mean speed and its distance at the end of each stroke."""
    columns, reasons = dict(table.columns), dict(table.reasons)
    speed, distance = boat["Speed"], boat["Distance"]
    found = {}
    if speed is not None:
        spans = zip(table["catch_time_s"], table["end_time_s"], strict=True)
        parts = [speed[(time_s >= begin_s) & (time_s < end_s)] for begin_s, end_s in spans]
        found["speed_m_s"] = np.array([part.mean() if len(part) else np.nan for part in parts])
    if distance is not None:
        found["distance_m"] = np.interp(table.stamp_s, time_s, distance, right=np.nan)
    for name, values in found.items():
        column = derived(values, "empty in the file during this stroke, or it has no end")
        if not column.is_empty:
            columns[name], reasons[name] = column.values, column.reasons
    return StrokeTable(
        columns,
        table.stds,
        reasons,
        table.curves,
        source=f"{grid.file.name}: {TITLE}, seat {seat}",
        notes=(*table.notes, _NOTE),
        onset=ONSET,
    )
