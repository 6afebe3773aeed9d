"""Reads marker trajectories from text tables: plain CSV, Trajectories of Vicon Nexus, TSV of Qualisys."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from oarlock.evaluation.markers.trajectories import Markers
from oarlock.formats.marker_table import (
    Row,
    filled,
    held_unit,
    markers_of,
    number,
    numbers,
    read_rows,
    read_text,
)
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_COLUMN = re.compile(r"(?P<name>.+)[ _.:](?P<axis>[xyz])(?:[ _]*[\[(]?(?P<unit>mm|cm|m)[\])]?)?", re.I)
_TIME = re.compile(r"(time|t)(?:[ _]*[\[(]?s(ec|econds)?[\])]?)?", re.I)


def read_marker_csv(file: Path, unit: str | None = None) -> Markers:
    """Read a text table of markers. Its first lines determine which of three kinds it is.

    - Plain: one header line with `time` (s) and `name_x`, `name_y`, `name_z` of each marker; a unit may follow, as in
      `wrist_x_mm` or `wrist X (mm)`. Other columns are ignored.
    - Vicon Nexus: the section `Trajectories`: rate, names, `Frame, Sub Frame, X, Y, Z, ...`, units.
    - Qualisys: lines `NO_OF_FRAMES`, `FREQUENCY`, `MARKER_NAMES` ..., then rows of coordinates in mm, with or without
      columns Frame and Time. Three coordinates of 0 mean not visible, as QTM writes it.

    Raises:
        DataError: none of these kinds, a missing unit, or a cell that is not a number, with file, line and column.
    """
    start = read_text(file)[:4000]
    if re.search(r"^\s*\"?Trajectories\b", start, re.M):
        return _read_nexus(file, unit)
    if re.search(r"^NO_OF_(FRAMES|MARKERS|CAMERAS)\b", start, re.M):
        return _read_qualisys(file, unit)
    return _read_plain(file, unit)


def _read_plain(file: Path, unit: str | None) -> Markers:
    header = next(line for line in read_text(file).splitlines() if line.strip())
    delimiter = max(",;\t", key=header.count)
    rows = [row for row in read_rows(file, delimiter) if filled(row)]
    if len(rows) < 2:
        raise DataError(f"{file}: has {len(rows)} lines; expected a header and a line for every frame")
    head, data = rows[0], rows[1:]
    times = [k for k, cell in enumerate(head.cells) if _TIME.fullmatch(cell)]
    if len(times) != 1:
        raise DataError(
            f'{file}:{head.line}: {len(times)} columns are called "time" or "time_s"; expected one'
        )
    names, columns, units = _plain_columns(head, file)
    said = units.pop() if len(units) == 1 else ""
    if len(units) > 1 and unit is None:
        raise DataError(f"{file}:{head.line}: columns have different units ({', '.join(sorted(units))})")
    held = held_unit(said, unit, f"{file}:{head.line}, header")
    if delimiter == ";":  # if semicolons separate columns, commas are decimal marks
        data = [Row(row.line, tuple(cell.replace(",", ".") for cell in row.cells)) for row in data]
    known = all(_TIME.fullmatch(cell) or _COLUMN.fullmatch(cell) for cell in head.cells)
    values = numbers(data, 0, len(head.cells), file) if known else _picked(data, columns, file)
    chosen = values[:, columns] if values.shape[1] == len(head.cells) else values
    return markers_of(file, names, _time_column(data, times[0], file), chosen, held)


def _picked(data: Sequence[Row], columns: Sequence[int], file: Path) -> Floats:
    rows = [Row(row.line, tuple(row.cells[c] if c < len(row.cells) else "" for c in columns)) for row in data]
    return numbers(rows, 0, len(columns), file)


def _plain_columns(head: Row, file: Path) -> tuple[list[str], list[int], set[str]]:
    """Names of the markers, their columns x, y, z one after the other, and the units named."""
    found: dict[str, dict[str, int]] = {}
    units: set[str] = set()
    for k, cell in enumerate(head.cells):
        if parts := _COLUMN.fullmatch(cell):
            axes = found.setdefault(parts["name"], {})
            if parts["axis"].lower() in axes:
                raise DataError(f'{file}:{head.line}: column "{cell}" occurs twice')
            axes[parts["axis"].lower()] = k
            units |= {parts["unit"].lower()} if parts["unit"] else set()
    for name, axes in found.items():
        if set(axes) != set("xyz"):
            have = ", ".join(f"{name}_{axis}" for axis in axes)
            raise DataError(f"{file}:{head.line}: marker {name!r} has {have} only; it needs x, y and z")
    if not found:
        raise DataError(
            f"{file}:{head.line}: no columns called name_x, name_y, name_z; found {', '.join(head.cells[:6])}"
        )
    return list(found), [axes[axis] for axes in found.values() for axis in "xyz"], units


def _read_nexus(file: Path, unit: str | None) -> Markers:
    rows = read_rows(file, "\t" if "\t" in read_text(file)[:4000] else ",")
    heads = (k for k, row in enumerate(rows) if row.cells and row.cells[0].startswith("Trajectories"))
    start = next(heads, None)
    if start is None:
        raise DataError(f'{file}: no line begins with "Trajectories", as a section of a Nexus export does')
    section = rows[start + 1 : start + 5]
    if (
        len(section) < 4
        or not filled(section[0])
        or section[2].cells[:1] != ("Frame",)
        or len(section[2].cells) < 2
    ):
        raise DataError(
            f"{file}:{rows[start].line}: expected rate, names, Frame and Sub Frame, and units after Trajectories"
        )
    rate, names_row, _, units_row = section
    rate_hz = number(rate.cells[0], rate.line, 1, file)
    if not rate_hz > 0.0:
        raise DataError(f"{file}:{rate.line}: the rate is {rate_hz:g} Hz; expected a positive number")
    names = [cell for cell in names_row.cells[2:] if cell]
    # a blank line ends the section; others may follow
    end = next((k for k in range(start + 5, len(rows)) if not filled(rows[k])), len(rows))
    data = rows[start + 5 : end]
    if not data or not names:
        raise DataError(
            f"{file}:{names_row.line}: Trajectories have {len(names)} markers in {len(data)} frames"
        )
    frames = np.array([number(row.cells[0], row.line, 1, file) for row in data])
    said = next((cell for cell in units_row.cells if cell), "")
    held = held_unit(said, unit, f"{file}:{units_row.line}")
    return markers_of(file, names, (frames - 1.0) / rate_hz, numbers(data, 2, 3 * len(names), file), held)


def _read_qualisys(file: Path, unit: str | None) -> Markers:
    rows = [row for row in read_rows(file, "\t") if filled(row)]
    first = next((k for k, row in enumerate(rows) if _starts_data(row)), len(rows))
    header = {row.cells[0].upper(): row for row in rows[:first]}
    for key in ("FREQUENCY", "MARKER_NAMES"):
        if key not in header or len(header[key].cells) < 2:
            raise DataError(f"{file}: a Qualisys export has a line {key}; export it with its header")
    names = [cell for cell in header["MARKER_NAMES"].cells[1:] if cell]
    rate_hz = number(header["FREQUENCY"].cells[1], header["FREQUENCY"].line, 2, file)
    data = rows[first:]
    if not data or not rate_hz > 0.0:
        raise DataError(f"{file}: has {len(data)} frames at {rate_hz:g} Hz; nothing to read")
    columns = header.get("FRAME")
    before = 0 if columns is None else 1 + (columns.cells[1:2] == ("Time",))
    values = numbers(data, before, 3 * len(names), file)
    held = "mm" if unit is None else unit
    triples = values.reshape(len(values), -1, 3)
    triples[(triples == 0.0).all(axis=2)] = np.nan
    time_s = _time_column(data, 1, file) if before == 2 else np.arange(len(data)) / rate_hz
    return markers_of(file, names, time_s, values, held)


def _starts_data(row: Row) -> bool:
    try:
        float(row.cells[0])
    except ValueError:
        return row.cells[0].upper() == "NULL"
    return True


def _time_column(data: Sequence[Row], column: int, file: Path) -> Floats:
    cells = [(row, row.cells[column] if column < len(row.cells) else "") for row in data]
    return np.array([number(cell, row.line, column + 1, file) for row, cell in cells])
