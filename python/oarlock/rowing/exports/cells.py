"""Converts cells to numbers: a missing one is NaN with a reason, an invalid one an error with its line."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.exports.grid import TableRows
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

DEGREE_RAD = np.pi / 180.0
POUND_FORCE_N = 4.4482216152605
MOST = 1e12
"""No number of a stroke is larger in size, in whatever unit."""

_MISSING = {"", "-", "--", "---", "nan", "inf", "-inf", "null", "none", "n/a"}
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?")
_DURATION = re.compile(r"(\d{1,6}:){0,2}\d{1,9}(\.\d{0,9})?")


@dataclass(frozen=True)
class Cells:
    """A column of the table (N,), and for each row why its number is NaN, or ""."""

    values: Floats
    reasons: tuple[str, ...]

    def but(self, rows: Bools, reason: str) -> Cells:
        """The same with NaN and a reason in some rows."""
        reasons = tuple(reason if bad else text for bad, text in zip(rows, self.reasons, strict=True))
        return Cells(np.where(rows, np.nan, self.values), reasons)

    @property
    def is_empty(self) -> bool:
        """Whether no row has a number."""
        return not np.isfinite(self.values).any()


def is_missing(cell: str) -> bool:
    """Whether a cell marks a missing value."""
    return cell.casefold() in _MISSING


def numbers(rows: TableRows, place: int, scale: float = 1.0) -> Cells:
    """A column as numbers times `scale`.

    Raises:
        DataError: a cell is neither a number nor a mark of a missing one; file, line, column.
    """
    return _column(rows, place, scale, _number)


def durations(rows: TableRows, place: int) -> Cells:
    """A column of clock times as seconds: `12.3`, `01:02.3`, `1:00:02.3`.

    Raises:
        DataError: a cell is no such time; file, line, column.
    """
    return _column(rows, place, 1.0, _duration_s)


def listed(rows: TableRows, place: int, row: int, separator: str = ",") -> Floats:
    """Parse a cell that contains a list of numbers, (K,).

    Raises:
        DataError: one of them is no number; file, line, column.
    """
    text = rows.cells[row][place].strip("[]")
    parts = [part.strip() for part in text.split(separator)] if text else []
    return np.array([_number(rows, place, row, part) for part in parts], dtype=np.float64)


def derived(values: Floats, reason: str) -> Cells:
    """A column that was computed: one reason wherever it is NaN."""
    return Cells(values, tuple("" if known else reason for known in np.isfinite(values)))


def _column(
    rows: TableRows, place: int, scale: float, read: Callable[[TableRows, int, int, str], float]
) -> Cells:
    values, reasons = np.full(len(rows), np.nan), []
    for row, cells in enumerate(rows.cells):
        cell = cells[place]
        missing = is_missing(cell)
        if not missing:
            values[row] = read(rows, place, row, cell)
        reasons.append((f'"{cell}" in the file' if cell else "empty in the file") if missing else "")
    return Cells(values * scale, tuple(reasons))


def _number(rows: TableRows, place: int, row: int, text: str) -> float:
    if _NUMBER.fullmatch(text) and abs(value := float(text)) <= MOST:
        return value
    hint = (
        " Is it a decimal comma? Export with decimal points." if re.fullmatch(r"[+-]?\d+,\d+", text) else ""
    )
    raise _wrong(rows, place, row, text, "a number", hint)


def _duration_s(rows: TableRows, place: int, row: int, text: str) -> float:
    if not _DURATION.fullmatch(text):
        raise _wrong(rows, place, row, text, "a time such as 00:01:02.3")
    seconds = 0.0
    for part in text.split(":"):
        seconds = 60.0 * seconds + float(part)
    return seconds


def _wrong(rows: TableRows, place: int, row: int, text: str, wanted: str, hint: str = "") -> DataError:
    shown = text if len(text) <= 40 else f"{text[:40]}..."
    where = f'{rows.file}:{rows.lines[row]}, column "{rows.names[place]}"'
    return DataError(f'{where}: "{shown}" is not {wanted}.{hint}')
