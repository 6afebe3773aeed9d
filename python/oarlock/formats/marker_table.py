"""Parses lines, cells, numbers and names of marker text files, for the marker readers of this folder."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from oarlock.evaluation.markers.trajectories import Markers
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.units import LENGTH, plain_unit, to_held_unit, unknown_unit_text

_MISSING = frozenset({"", "nan", "null", "none", "-nan", "nan(ind)", "-nan(ind)", "---"})


@dataclass(frozen=True)
class Row:
    """One line of a file: its number from 1 and its cells, without spaces around them."""

    line: int
    cells: tuple[str, ...]


def read_rows(file: Path, delimiter: str) -> list[Row]:
    """All lines, split at a delimiter. Quotes are supported for commas and semicolons.

    Raises:
        DataError: the file cannot be read, or contains zero bytes and so is not text.
    """
    text = read_text(file)
    if delimiter in ",;":
        split = csv.reader(text.splitlines(), delimiter=delimiter)
        return [Row(k, tuple(cell.strip() for cell in cells)) for k, cells in enumerate(split, start=1)]
    lines = text.splitlines()
    return [
        Row(k, tuple(cell.strip() for cell in line.split(delimiter))) for k, line in enumerate(lines, start=1)
    ]


def read_text(file: Path) -> str:
    """A file's text: UTF-8 with or without byte order mark, UTF-16 with mark, otherwise Latin-1.

    Raises:
        DataError: the file cannot be read, is empty, or is not text.
    """
    raw = read_bytes(file)
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = raw.decode("utf-16", errors="replace")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
    if "\x00" in text:
        raise DataError(f"{file}: contains zero bytes, so it is not text. Is it a renamed C3D file?")
    if not text.strip():
        raise DataError(f"{file}: is empty")
    return text


def filled(row: Row) -> bool:
    """Whether a cell is not empty."""
    return any(row.cells)


def numbers(rows: Sequence[Row], start: int, width: int, file: Path) -> Floats:
    """Cells `start` to `start + width` of every row, (rows, width); NaN where missing or where a row ends early.

    Raises:
        DataError: a cell that is not a finite number, or a filled cell beyond the last column.
    """
    values = np.full((len(rows), width), np.nan)
    for k, row in enumerate(rows):
        if any(row.cells[start + width :]):
            raise DataError(
                f"{file}:{row.line}: has {len(row.cells)} cells, but the header has {start + width}"
            )
        for i, cell in enumerate(row.cells[start : start + width]):
            if cell and cell.lower() not in _MISSING:
                values[k, i] = number(cell, row.line, start + i + 1, file)
    return values


def number(cell: str, line: int, column: int, file: Path) -> float:
    """One cell as a finite number.

    Raises:
        DataError: it is not a finite number; the text names file, line and column.
    """
    try:
        value = float(cell) if "_" not in cell else float("nan")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        hint = (
            " Is it a decimal comma? Write it with a point."
            if cell.replace(",", "", 1).lstrip("-").isdigit()
            else ""
        )
        raise DataError(f'{file}:{line}, column {column}: "{cell}" is not a finite number.{hint}')
    return value


def held_unit(said: str, asked: str | None, where: str) -> str:
    """The unit of length: the requested one, otherwise that of the file.

    Raises:
        DataError: neither names a known unit of length.
    """
    if asked is not None:
        return asked
    unit = plain_unit(said).lower()
    spelled = {
        "meters": "m",
        "meter": "m",
        "metres": "m",
        "millimeters": "mm",
        "millimetres": "mm",
        "centimeters": "cm",
    }
    unit = spelled.get(unit, unit)
    if unit not in LENGTH:
        hint = unknown_unit_text(said, LENGTH) if said else "no unit of length is named."
        raise DataError(f'{where}: {hint} Give unit="mm" or unit="m".')
    return unit


def short_names(names: Sequence[str]) -> tuple[str, ...]:
    """Names without the subject before the colon, unless two names would become equal."""
    short = tuple(name.rpartition(":")[2].strip() or name for name in names)
    return short if max(Counter(short).values(), default=0) <= 1 else tuple(names)


def markers_of(file: Path, names: Sequence[str], time_s: Floats, values: Floats, unit: str) -> Markers:
    """Markers from rows of 3 n numbers in `unit`; errors name the file."""
    position = to_held_unit(values, unit).reshape(len(values), len(names), 3)
    try:
        return Markers(short_names(names), time_s, position)
    except DataError as error:
        raise DataError(f"{file}: {error}") from error
