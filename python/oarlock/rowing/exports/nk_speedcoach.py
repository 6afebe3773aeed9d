"""Reads NK SpeedCoach CSV (NK LiNK): speed, rate and, with an EmPower oarlock, angles and force of every stroke."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from oarlock.rowing.exports.build import NAMED, ColumnMap, TableBuilder, left_out_note, many, twice_note
from oarlock.rowing.exports.cells import DEGREE_RAD, POUND_FORCE_N, Cells, is_missing
from oarlock.rowing.exports.grid import CellGrid, TableRows, plain_name
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.errors import DataError

_BEYOND_SHARE = 0.02
"""More strokes than this with the peak of force beyond the finish, and its angle is none of the oar."""


def told_angles(gathered: TableBuilder) -> None:
    """Checks signs and the meaning of the angle of peak force.

    NK counts oar angles from the oar across the boat, catch negative, finish positive, as Oarlock does. LiNK 1.26 wrote
    the angle of peak force as travel from the catch: then strokes have it beyond their finish.
    """
    catch, finish = gathered.values("catch_angle_rad"), gathered.values("finish_angle_rad")
    if (catch > 0.0).sum() > (catch < 0.0).sum():
        gathered.notes.append(
            "catch angles are positive in most strokes, against NK's sign: check how the oarlock sits"
        )
    peak = gathered.values("peak_force_angle_rad")
    beyond = peak > finish
    if beyond.sum() > _BEYOND_SHARE * np.isfinite(peak).sum():
        gathered.columns["peak_force_travel_rad"] = gathered.columns.pop("peak_force_angle_rad")
        gathered.notes.append(
            f"the angle of peak force lies beyond the finish in {many(beyond.sum(), 'stroke')}, so it is no oar "
            "angle; it is taken as travel from the catch, peak_force_travel_rad"
        )


def add_arcs(gathered: TableBuilder) -> None:
    """Arc, and arc without slip and wash."""
    arc = gathered.values("finish_angle_rad") - gathered.values("catch_angle_rad")
    effective = arc - gathered.values("slip_rad") - gathered.values("wash_rad")
    gathered.derive("arc_rad", arc, "an angle is missing")
    gathered.derive(
        "effective_arc_rad", effective, "slip or wash is missing: force stayed below the threshold"
    )


TITLE = "NK SpeedCoach, strokes (CSV of NK LiNK)"
MARKS = ("Interval", "Elapsed Time", "Stroke Rate")

_MILE_M = 1609.344
_HOUR_S = 3600.0
_UNITS = {
    "m": {"(meters)": 1.0, "(kilometers)": 1000.0, "(miles)": _MILE_M},
    "m/s": {"(m/s)": 1.0, "(kph)": 1000.0 / _HOUR_S, "(mph)": _MILE_M / _HOUR_S},
    "rad": {"(degrees)": DEGREE_RAD},
    "N": {"(newtons)": 1.0, "(pounds)": POUND_FORCE_N, "(lbs)": POUND_FORCE_N},
    "J": {"(joules)": 1.0},
    "W": {"(watts)": 1.0},
    "1/min": {"(spm)": 1.0, "(bpm)": 1.0},
    "1": {"(interval)": 1.0, "(strokes)": 1.0},
}
# name in the table, unit, names in the file
_COLUMNS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("interval", "1", ("Interval",)),
    ("stroke_number", "1", ("Total Strokes", "Stroke Count")),
    ("distance_m", "m", ("Distance (GPS)", "GPS Distance")),
    ("impeller_distance_m", "m", ("Distance (IMP)", "Imp Distance")),
    ("speed_m_s", "m/s", ("Speed (GPS)", "GPS Speed")),
    ("impeller_speed_m_s", "m/s", ("Speed (IMP)", "Imp Speed")),
    ("distance_per_stroke_m", "m", ("Distance/Stroke (GPS)",)),
    ("rate_per_min", "1/min", ("Stroke Rate",)),
    ("heart_rate_per_min", "1/min", ("Heart Rate",)),
    ("catch_angle_rad", "rad", ("Catch",)),
    ("finish_angle_rad", "rad", ("Finish",)),
    ("slip_rad", "rad", ("Slip",)),
    ("wash_rad", "rad", ("Wash",)),
    ("peak_force_n", "N", ("Force Max",)),
    ("mean_force_n", "N", ("Force Avg",)),
    ("peak_force_angle_rad", "rad", ("Max Force Angle", "Force Max Angle")),
    ("work_j", "J", ("Work",)),
    ("power_w", "W", ("Power",)),
)
_NOT_COUNTED = "--- in the file: the oarlock measured a stroke that the SpeedCoach did not count"


def read(grid: CellGrid, header: int) -> StrokeTable:
    """A file of NK LiNK; the order of its columns changes with its version, so they are found by name."""
    rows, empty = _strokes(grid, header)
    gathered = TableBuilder(rows)
    if empty:
        gathered.notes.append(f"{many(empty, 'row')} below the strokes with nothing in the named columns")
    units = _units(grid, header)
    gathered.notes += _swapped_units(units)
    gathered.read([ColumnMap("time_s", ("Elapsed Time",), is_time=True)])
    gathered.read(
        ColumnMap(name, heads, _scale(rows, units, unit, heads), zero_is_missing=name.startswith("impeller"))
        for name, unit, heads in _COLUMNS
    )
    _name_oarlock_strokes(gathered)
    if "catch_angle_rad" in gathered.columns:
        gathered.notes += _settings(grid, header)
        told_angles(gathered)
        add_arcs(gathered)
    # the SpeedCoach's count begins again with each interval
    number = np.where(np.isnan(gathered.values("time_s")), np.nan, gathered.values("stroke_number"))
    gathered.notes += left_out_note(number, rows.lines) + twice_note(number, rows.lines)
    return gathered.table(TITLE)


def _strokes(grid: CellGrid, header: int) -> tuple[TableRows, int]:
    """The rows of strokes, and how many others there are: people make notes to the right of and below the table."""
    rows = grid.rows(header, skipped=1)
    named = [k for k, name in enumerate(rows.names) if name]
    kept = [row for row, cells in enumerate(rows.cells) if any(cells[k] for k in named)]
    return rows.chosen(kept), len(rows) - len(kept)


def _units(grid: CellGrid, header: int) -> dict[str, str]:
    """The row of units below the header, by column name."""
    names = grid.cells[header]
    units = grid.cells[header + 1] if header + 1 < len(grid.cells) else []
    if not units or plain_name(units[0]) != "(interval)":
        line = grid.lines[header]
        raise DataError(
            f"{grid.file}:{line}: the header is not followed by a row of units, which begins (Interval)"
        )
    return {plain_name(name): plain_name(unit) for name, unit in zip(names, units, strict=False) if name}


def _swapped_units(units: dict[str, str]) -> list[str]:
    if (units.get("work"), units.get("power")) != ("(watts)", "(joules)"):
        return []
    units["work"], units["power"] = "(joules)", "(watts)"
    return [
        "the file's units of Work and Power are exchanged (Watts, Joules); by their names they are J and W"
    ]


def _scale(rows: TableRows, units: dict[str, str], unit: str, heads: tuple[str, ...]) -> float:
    place = rows.place(*heads)
    if place is None:
        return 1.0
    written = units.get(plain_name(rows.names[place]), "")
    if written not in _UNITS[unit]:
        raise DataError(
            f'{rows.file}, column "{rows.names[place]}": the unit "{written}" is not known; '
            f"known are {', '.join(_UNITS[unit])}"
        )
    return _UNITS[unit][written]


def _name_oarlock_strokes(gathered: TableBuilder) -> None:
    """Rows that only the oarlock wrote have no time, speed and rate."""
    if "time_s" not in gathered.columns or "catch_angle_rad" not in gathered.columns:
        return
    alone = np.isnan(gathered.values("time_s")) & np.isfinite(gathered.values("catch_angle_rad"))
    for name, column in gathered.columns.items():
        rows = alone & np.isnan(column.values)
        gathered.columns[name] = Cells(column.values, column.but(rows, _NOT_COUNTED).reasons)
    if alone.any():
        gathered.notes.append(
            f"the oarlock measured {many(alone.sum(), 'stroke')} that the SpeedCoach did not count"
        )


def _settings(grid: CellGrid, header: int) -> list[str]:
    """What the head of the file says of the oarlock: side, oar, firmware."""
    found: dict[str, str] = {}
    for row in grid.cells[:header]:
        for name, value in pairwise(row):
            if name.endswith(":"):  # a session's name stands before its device's
                found.setdefault(plain_name(name), value)
    found = {name: value for name, value in found.items() if value and not is_missing(value)}
    side, firmware = found.get("port starboard:", ""), found.get("firmware:", "")
    names = [f"{word} {found[key]}" for word, key in _NAMES if key in found]
    notes = [f"{NAMED}{', '.join(names)}"] if names else []
    notes += [f"oarlock on {side.lower()}"] if side.lower() in ("port", "starboard") else []
    lengths = [
        f"{name} {found[key]} cm" for name, key in _LENGTHS if _PLAUSIBLE_CM.fullmatch(found.get(key, ""))
    ]
    told = [*lengths, *([f"oarlock firmware {firmware}"] if firmware else [])]
    return [*notes, f"set at the device: {', '.join(told)}"] if told else notes


_PLAUSIBLE_CM = re.compile(r"[1-9]\d{1,2}(\.\d+)?")  # some versions write the rubbish of unset memory
_NAMES = (("session", "name:"), ("boat", "boat id:"))
_LENGTHS = (("oar", "oar length:"), ("inboard", "inboard length:"))
