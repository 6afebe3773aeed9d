"""Builds a `StrokeTable` from columns of a file, with reasons and notes on clock and counter, for all readers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from oarlock.rowing.exports.cells import Cells, derived, durations, numbers
from oarlock.rowing.exports.grid import TableRows
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

NAMED = "named in the file: "
"""Begins a note on the session and boat that a file names."""
_MOST_NAMED = 5


@dataclass(frozen=True)
class ColumnMap:
    """Which column of a file becomes which of the table.

    Attributes:
        name: in the table, with its unit.
        headers: names in the file, the first that is there is read.
        scale: a cell times this is in the unit of `name`.
        is_time: whether cells are clock times such as 01:02.3.
        zero_is_missing: whether the device writes 0 for what it did not measure.
    """

    name: str
    headers: tuple[str, ...]
    scale: float = 1.0
    is_time: bool = False
    zero_is_missing: bool = False


@dataclass
class TableBuilder:
    """What has been read so far of one file's rows."""

    rows: TableRows
    columns: dict[str, Cells] = field(default_factory=dict)
    curves: dict[str, tuple[Floats, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    onset: str = ""

    def read(self, wanted: Iterable[ColumnMap]) -> None:
        """Reads those of the wanted columns that the file has; one that is empty in all rows is only noted."""
        empty = []
        for one in wanted:
            place = self.rows.place(*one.headers)
            if place is None:
                continue
            column = durations(self.rows, place) if one.is_time else numbers(self.rows, place, one.scale)
            if one.zero_is_missing:
                column = column.but(column.values == 0.0, "0 in the file: not measured")
            if column.is_empty:
                empty.append(self.rows.names[place])
            else:
                self.columns[one.name] = column
        if empty:
            self.notes.append(f"without a number in any row: {', '.join(empty)}")

    def values(self, name: str) -> Floats:
        """A column's numbers, (N,); NaN without such a column."""
        return self.columns[name].values if name in self.columns else np.full(len(self.rows), np.nan)

    def number_from_one(self, name: str) -> None:
        """Turns a device's own identifiers into 1, 2, 3 in the order in which they come."""
        if name in self.columns:
            column = self.columns[name]
            known = {value: place + 1.0 for place, value in enumerate(dict.fromkeys(column.values))}
            numbered = [known[value] if np.isfinite(value) else np.nan for value in column.values]
            self.columns[name] = Cells(np.array(numbered), column.reasons)

    def derive(self, name: str, values: Floats, reason: str) -> None:
        """Adds a computed column, unless it is NaN in all rows."""
        column = derived(values, reason)
        if not column.is_empty:
            self.columns[name] = column

    def table(self, title: str) -> StrokeTable:
        """The table; `title` says what wrote the file.

        Raises:
            DataError: there are no rows, or none of the known columns holds a number.
        """
        file = self.rows.file
        if not len(self.rows):
            raise DataError(f"{file}: is {title}, but contains no strokes")
        if not self.columns:
            raise DataError(f"{file}: is {title}, but none of its columns contains a number")
        self.notes += clock_notes(self.values("time_s"), self.values("interval"), self.rows.lines)
        return StrokeTable(
            columns={name: column.values for name, column in self.columns.items()},
            reasons={name: column.reasons for name, column in self.columns.items() if any(column.reasons)},
            curves=self.curves,
            source=f"{file.name}: {title}",
            notes=tuple(self.notes),
            onset=self.onset,
        )


def clock_notes(time_s: Floats, interval: Floats, lines: Sequence[int]) -> list[str]:
    """Lines of the file at which a clock stops or restarts, as notes."""
    known = np.flatnonzero(np.isfinite(time_s))
    step_s = np.diff(time_s[known])
    places = known[1:]
    back, same = places[step_s < 0.0], places[step_s == 0.0]
    notes = []
    if len(back):
        intervals = np.nan_to_num(interval)
        all_new = all(intervals[place] != intervals[place - 1] for place in back)
        what = "with each interval" if all_new else "or goes back"
        notes.append(f"the clock begins again {what}: {_named(back.tolist(), lines)}")
    if len(same):
        notes.append(f"the same time as the stroke before: {_named(same.tolist(), lines)}")
    return notes


def left_out_note(number: Floats, lines: Sequence[int]) -> list[str]:
    """Notes on strokes that are missing in the file, from the device's stroke count."""
    known = np.flatnonzero(np.isfinite(number))
    step = np.diff(number[known])
    gaps = known[1:][step > 1.0]
    lost = int((step[step > 1.0] - 1.0).sum())
    where = _named(gaps.tolist(), lines)
    return [f"the device's count leaves out {many(lost, 'stroke')}, not in the file: {where}"] if lost else []


def twice_note(number: Floats, lines: Sequence[int]) -> list[str]:
    """Rows whose count is that of the row before."""
    known = np.flatnonzero(np.isfinite(number))
    twice = known[1:][np.diff(number[known]) == 0.0]
    return [f"the count of the row before comes again: {_named(twice.tolist(), lines)}"] if len(twice) else []


def many(count: int, noun: str) -> str:
    """A number of things: "1 row", "2 rows"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _named(places: Sequence[int], lines: Sequence[int]) -> str:
    shown = ", ".join(str(lines[place]) for place in places[:_MOST_NAMED])
    more = len(places) - _MOST_NAMED
    return f"line{'s' if len(places) > 1 else ''} {shown}{f' and {more} more' if more > 0 else ''}"
