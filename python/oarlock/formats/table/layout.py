"""How a table of text is written: encoding, delimiter, decimal mark, header, units; found from its start."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from oarlock.formats.table.header import channel_of, looks_like_units
from oarlock.storage.delimited import MISSING_MARKERS, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

START_BYTES = 2**20
"""Headers of 600 columns have 25 kB, and rows of them 10 kB."""
_START_LINES = 400
_DELIMITERS = ("\t", ";", ",", "|")
_MOST_BETWEEN = 4
"""Lines from the names to the first row of data."""
_LEAST_COLUMNS = 3
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT_NUMBER = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class TableStart:
    """The layout of a table and its first rows.

    Args:
        file: the table.
        dialect: how it is written.
        names: of the columns.
        units: texts of the line below the names, one a column; empty texts without such a line.
        above: lines above the names.
        rows: the first rows of numbers.
    """

    file: Path
    dialect: Dialect
    names: tuple[str, ...]
    units: tuple[str, ...]
    above: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def table_start(file: Path) -> TableStart:
    """The layout of a table.

    Raises:
        DataError: It is no text, or no table of numbers with names of columns.
    """
    text, encoding = _text(file)
    lines = list(io.StringIO(text, newline=""))[:_START_LINES]
    found = [start for delimiter in _DELIMITERS if (start := _start(file, lines, delimiter, encoding))]
    if not found:
        raise DataError(f"{file}: is no table of numbers with a line of column names")
    channels = [sum(channel_of(name) is not None for name in one.names) for one in found]
    return max(zip(channels, found, strict=True), key=lambda pair: (pair[0], len(pair[1].names)))[1]


def _text(file: Path) -> tuple[str, str]:
    with open_regular(file) as stream:
        start = stream.read(START_BYTES)
    if not start:
        raise DataError(f"{file}: is empty")
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return start.decode("utf-16", "ignore"), "utf-16"
    if b"\0" in start:
        raise DataError(f"{file}: is no text")
    try:
        # The last character may be cut.
        return start[: -4 if len(start) == START_BYTES else None].decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        return start.decode("cp1252", "replace"), "cp1252"


def _start(file: Path, lines: Sequence[str], delimiter: str, encoding: str) -> TableStart | None:
    rows = list(_rows(lines, delimiter))
    first = next((place for place in range(1, len(rows)) if _is_data(rows, place)), None)
    if first is None:
        return None
    width = len(rows[first][1])
    header = _header(rows, first)
    if header is None:
        return None
    number, names = rows[header]
    below = rows[header + 1][1] if header + 1 < first else []
    units = below if len(below) == width and looks_like_units(below) else [""] * width
    kept = [cells for _, cells in rows[first:] if len(cells) == width]
    dialect = Dialect(
        delimiter=delimiter,
        decimal=_decimal(kept, delimiter),
        encoding=encoding,
        skip_rows=number,
        skip_after_header=first - header - 1,
        missing=_missing(kept),
    )
    return TableStart(
        file,
        dialect,
        tuple(name.strip() for name in names),
        tuple(unit.strip() for unit in units),
        tuple(line.strip() for line in lines[:number]),
        tuple(tuple(cells) for cells in kept),
    )


def _header(rows: Sequence[tuple[int, list[str]]], first: int) -> int | None:
    """The line of names above the first row of data; units, rates and periods may stand between."""
    width = len(rows[first][1])
    places = [
        place
        for place in range(max(0, first - _MOST_BETWEEN), first)
        if len(rows[place][1]) == width and _share_of_numbers(rows[place][1]) == 0.0
    ]
    channels = {place: sum(channel_of(name) is not None for name in rows[place][1]) for place in places}
    if not places:
        return None
    if max(channels.values()) == 0 and len(places) > 1 and looks_like_units(rows[places[-1]][1]):
        places.pop()
    return max(places, key=lambda place: (channels[place], place))


def _rows(lines: Sequence[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Number, from 0, and cells of each line that is not blank."""
    for number, line in enumerate(lines):
        try:
            cells = next(csv.reader([line], delimiter=delimiter), [])
        except csv.Error:
            cells = [line]
        if cells:
            yield number, cells


def _is_data(rows: Sequence[tuple[int, list[str]]], place: int) -> bool:
    """True if this row and one of the next two have numbers in columns, and the row above has not."""
    cells = rows[place][1]
    if len(cells) < _LEAST_COLUMNS or _share_of_numbers(cells) < 0.5:
        return False
    following = [other for _, other in rows[place + 1 : place + 3]]
    alike = not following or any(
        len(other) == len(cells) and _share_of_numbers(other) >= 0.5 for other in following
    )
    return alike and _share_of_numbers(rows[place - 1][1]) < 0.5


def _share_of_numbers(cells: Sequence[str]) -> float:
    filled = [cell.strip() for cell in cells if cell.strip() not in MISSING_MARKERS]
    if not filled:
        return 0.0
    return sum(_NUMBER.fullmatch(cell) is not None for cell in filled) / len(filled)


def _decimal(rows: Sequence[Sequence[str]], delimiter: str) -> str:
    cells = [cell.strip() for row in rows for cell in row]
    commas = sum(_COMMA_NUMBER.fullmatch(cell) is not None for cell in cells)
    points = sum(_POINT_NUMBER.fullmatch(cell) is not None for cell in cells)
    return "," if delimiter != "," and commas > points else "."


def _missing(rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The usual texts for missing readings, and others that stand among numbers and mean the same in many programs."""
    usual = ("n/a", "na", "null", "none", "-", "#n/a")
    found = {cell.strip() for row in rows for cell in row if cell.strip().lower() in usual}
    return (*MISSING_MARKERS, *sorted(found))
