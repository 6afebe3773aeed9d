"""Tables of numbers below free lines, as makers' software exports them. For the readers of this folder.

Encoding, separator and decimal mark are recognised from the first rows.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from oarlock.formats.columns import Places
from oarlock.formats.listing import ListedFile, listed
from oarlock.storage.array_gate import disorder_text
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.delimited import ColumnLayout, Dialect, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

_SEPARATORS = ("\t", ";", ",", " ")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_MISSING = ("", "NaN", "---")


@dataclass(frozen=True)
class Header:
    """The line of names in a text.

    Args:
        row: its place among the lines, from 0.
        separator: one character between fields.
        names: the names, without spaces around them.
    """

    row: int
    separator: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class ExportedTable:
    """A file whose header was found.

    Args:
        layout: where its columns stand.
        above: the lines above the names.
        below: the lines between the names and the data, such as one of units, without separating them.
    """

    layout: ColumnLayout
    above: tuple[str, ...]
    below: tuple[str, ...]

    @property
    def file(self) -> Path:
        """The file."""
        return self.layout.file

    def present(self, names: Sequence[str]) -> bool:
        """True if the file has columns of all these names, False if of none.

        Raises:
            DataError: it has some of them.
        """
        found = [name for name in names if name in self.layout.names]
        if found and len(found) < len(names):
            missing = next(name for name in names if name not in found)
            raise DataError(
                f'{self.file}: has a column "{found[0]}" but none "{missing}". '
                f"{did_you_mean(missing, self.layout.names)}"
            )
        return bool(found)


@dataclass(frozen=True)
class Columns:
    """Columns of a file by name: numbers, and texts where they were asked for."""

    layout: ColumnLayout
    lines: Ints
    values: Mapping[str, Floats]
    texts: Mapping[str, list[str]]

    def rows(self, names: Sequence[str]) -> Floats:
        """(T, len(names)) of these columns."""
        return np.column_stack([self.values[name] for name in names])

    def once(self) -> Columns:
        """Without rows that repeat the one before in every number: the same packet, written twice."""
        table = np.column_stack(list(self.values.values()))
        same = (table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))
        kept = np.concatenate([[True], ~same.all(axis=1)])
        if self.texts or kept.all():
            return self
        return Columns(self.layout, self.lines[kept], {n: v[kept] for n, v in self.values.items()}, {})

    def places(self, name: str) -> Places:
        """File, line and column of the cells of a column."""
        return Places(self.layout, self.lines, self.layout.index(name))

    def present(self, name: str, what: str) -> Floats:
        """The numbers of a column in which none may be missing; `what` they are, for the error."""
        values = self.values[name]
        missing = np.flatnonzero(np.isnan(values))
        if missing.size:
            raise DataError(
                f"{self.places(name)[missing[0]]}: the {what} is missing ({missing.size} of {values.size} rows). "
                "Remove these rows."
            )
        return values

    def check_increasing(self, time_s: Floats, name: str, hint: str = "") -> None:
        """Refuse time stamps of a column that repeat or go back."""
        late = np.flatnonzero(np.diff(time_s) <= 0.0)
        if late.size:
            index = int(late[0]) + 1
            raise DataError(f"{self.places(name)[index]}: time_s{disorder_text(time_s, index)}{hint}")


def found_header(
    lines: Sequence[str], containing: str, is_header: Callable[[Sequence[str]], bool]
) -> Header | None:
    """The first line with this text whose fields are names, as `is_header` decides; None if there is none."""
    for row, line in enumerate(lines):
        for separator in _SEPARATORS if containing in line else ():
            names = tuple(cell.strip().strip('"').strip() for cell in line.split(separator))
            if len(names) > 1 and is_header(names):
                return Header(row, separator, names)
    return None


def single_file(path: Path) -> ListedFile:
    """A file with its first lines.

    Raises:
        DataError: it is a folder, or cannot be read.
    """
    if path.is_dir():
        raise DataError(f"{path}: is a folder; give a file")
    return listed(path).files[0]


def exported_table(one: ListedFile, header: Header, lines_below: int = 0) -> ExportedTable:
    """The layout of a file whose header was found in its first lines.

    Args:
        one: the file.
        header: its line of names.
        lines_below: lines between the names and the data.
    """
    below = one.lines[header.row + 1 : header.row + 1 + lines_below]
    rows = [line for line in one.lines[header.row + 1 + lines_below :] if line.strip()]
    cells = [row.split(header.separator) for row in rows]
    dialect = Dialect(
        header.separator,
        _decimal(header.separator, cells),
        _encoding(one.head),
        header.row,
        skip_after_header=lines_below,
        missing=_MISSING,
    )
    names = header.names
    if cells and len(cells[0]) == len(names) + 1 and not cells[0][-1].strip():
        names = (*names, "")
    elif cells and len(cells[0]) == len(names) - 1 and not names[-1]:
        names = names[:-1]
    return ExportedTable(ColumnLayout(one.path, dialect, names, len(names)), one.lines[: header.row], below)


def read_columns_of(table: ExportedTable, names: Sequence[str], texts: Sequence[str] = ()) -> Columns:
    """Columns by name.

    Args:
        table: the file.
        names: columns of numbers; NaN where a cell is empty.
        texts: columns whose cells are wanted as they stand.

    Raises:
        DataError: A column is missing, a cell is not a number (file, line, column), or there are no rows.
    """
    layout = table.layout
    wanted = list(dict.fromkeys((*names, *texts)))
    indices = [layout.index(name) for name in wanted]
    lines: list[int] = []
    parts: dict[str, list[Floats]] = {name: [] for name in names}
    cells: dict[str, list[str]] = {name: [] for name in texts}
    for batch in layout.batches(indices):
        lines += batch.lines
        for position, name in enumerate(wanted):
            if name in parts:
                parts[name].append(numbers(layout, batch, position, indices[position]))
            if name in cells:
                cells[name] += batch.cells[position]
    if not lines:
        raise DataError(f"{layout.file}: has a header but no rows of data")
    values = {name: np.concatenate(found) for name, found in parts.items()}
    return Columns(layout, np.array(lines, dtype=np.int64), values, cells)


def _decimal(separator: str, rows: Sequence[Sequence[str]]) -> str:
    cells = [cell.strip() for row in rows for cell in row]
    with_comma = separator != "," and any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
    return "," if with_comma and not any("." in cell for cell in cells) else "."


def _encoding(head: bytes) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        # A character may be cut at the end of the head.
        return "utf-8" if error.start >= len(head) - 3 else "latin-1"
    return "utf-8"
