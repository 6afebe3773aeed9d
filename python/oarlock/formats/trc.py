"""Reads TRC files (track row column), the marker format of Motion Analysis and OpenSim, for `load_markers`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from oarlock.evaluation.markers.trajectories import Markers
from oarlock.formats.marker_table import Row, filled, held_unit, markers_of, number, numbers, read_rows
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError


def read_trc(file: Path, unit: str | None = None) -> Markers:
    """Read a TRC file.

    Header lines are found by their content, not by their number; blank lines between them are allowed. Names are three
    columns apart or, from some writers, in adjacent columns. Cells that are empty, `NaN` in any spelling, or missing at
    the end of a line mean that the marker was not visible. Time stamps come from the column Time.

    Raises:
        DataError: a header line is missing, names and `NumMarkers` disagree, or a cell is not a number.
    """
    rows = [row for row in read_rows(file, "\t") if filled(row)]
    settings = _settings(rows, file)
    head = _row_starting(rows, "Frame#", file)
    names = _names(rows[head], settings, file)
    data = rows[head + 1 :]
    # the line of X1, Y1, Z1 has no frame number before it
    while data and not data[0].cells[0] and not _is_number(data[0].cells[1:2]):
        data = data[1:]
    if not data:
        raise DataError(f"{file}: has a header but no frames")
    held = held_unit(settings.get("Units", ""), unit, f'{file}, "Units"')
    values = numbers(data, 2, 3 * len(names), file)
    return markers_of(file, names, _stamps(data, file), values, held)


def _settings(rows: Sequence[Row], file: Path) -> dict[str, str]:
    start = _row_starting(rows, "DataRate", file)
    if start + 1 >= len(rows):
        raise DataError(f"{file}: ends after the line of DataRate; its values are missing")
    labels, cells = rows[start].cells, rows[start + 1].cells
    return {label: cell for label, cell in zip(labels, cells, strict=False) if label}


def _row_starting(rows: Sequence[Row], word: str, file: Path) -> int:
    for k, row in enumerate(rows):
        if row.cells[0].split(" ")[0].casefold() == word.casefold():
            return k
    raise DataError(
        f'{file}: no line starts with "{word}", so this is not a TRC file (columns are separated by tabs)'
    )


def _names(row: Row, settings: dict[str, str], file: Path) -> tuple[str, ...]:
    names = tuple(cell for cell in row.cells[2:] if cell)
    count = settings.get("NumMarkers", "")
    if not names:
        raise DataError(f"{file}:{row.line}: has no marker name after Time")
    if count.isdigit() and int(count) != len(names):
        raise DataError(
            f"{file}:{row.line}: names {len(names)} markers, but NumMarkers is {count}. Is a name empty, or the line "
            "cut off?"
        )
    return names


def _stamps(data: Sequence[Row], file: Path) -> Floats:
    cells = [(row, row.cells[1] if len(row.cells) > 1 else "") for row in data]
    return np.array([number(cell, row.line, 2, file) for row, cell in cells])


def _is_number(cells: Sequence[str]) -> bool:
    try:
        return bool(cells) and np.isfinite(float(cells[0]))
    except ValueError:
        return False
