"""A text file as rows of cells, whatever its delimiter and encoding; the rows of one table in it."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

_BYTE_ORDER_MARKS = (b"\xff\xfe", b"\xfe\xff")
_MOST_BYTES = 200_000_000
_DELIMITERS = ",;\t"
_HEADER_WITHIN = 200  # rows
_HEAD = 20_000  # characters


@dataclass(frozen=True)
class TableRows:
    """The rows of one table: the line number of each, and its cells without surrounding blanks.

    Attributes:
        file: the file.
        names: of the columns, as the file writes them.
        lines: the line in which each row ends, from 1.
        cells: one list a row; a row has at least as many cells as there are names.
    """

    file: Path
    names: tuple[str, ...]
    lines: tuple[int, ...]
    cells: tuple[list[str], ...]

    def __len__(self) -> int:
        return len(self.cells)

    def place(self, *names: str) -> int | None:
        """Position of the first column with one of these names, ignoring case; None if there is none."""
        plain = [plain_name(name) for name in self.names]
        found = [plain.index(plain_name(name)) for name in names if plain_name(name) in plain]
        return found[0] if found else None

    def chosen(self, kept: Iterable[int]) -> TableRows:
        """Some of the rows, in this order."""
        places = list(kept)
        lines, cells = [self.lines[k] for k in places], [self.cells[k] for k in places]
        return TableRows(self.file, self.names, tuple(lines), tuple(cells))


@dataclass(frozen=True)
class CellGrid:
    """All rows of a file under one delimiter."""

    file: Path
    lines: tuple[int, ...]
    cells: tuple[list[str], ...]

    def header(self, marks: Collection[str]) -> int | None:
        """The first row that contains all of these names."""
        wanted = {plain_name(mark) for mark in marks}
        for place, row in enumerate(self.cells[:_HEADER_WITHIN]):
            if len(row) >= len(wanted) and wanted <= {plain_name(cell) for cell in row}:
                return place
        return None

    def rows(self, header: int, skipped: int = 0, until_blank: bool = False) -> TableRows:
        """The table below a header.

        Args:
            header: its place.
            skipped: rows between the header and the first row of data, such as one of units.
            until_blank: whether the table ends at the first blank row.

        Raises:
            DataError: a row has another number of cells than the header; file and line.
        """
        heads = self.cells[header]
        width = max((k for k, name in enumerate(heads, 1) if name), default=0)
        names, first = tuple(heads[:width]), header + 1 + skipped
        lines: list[int] = []
        cells: list[list[str]] = []
        for line, row in zip(self.lines[first:], self.cells[first:], strict=True):
            if not any(row):
                if until_blank and cells:
                    break
                continue
            if len(row) < width:
                raise DataError(
                    f"{self.file}:{line}: has {len(row)} cells, the header has {width}. Is the row cut off?"
                )
            lines.append(line)
            cells.append(row)
        return TableRows(self.file, names, tuple(lines), tuple(cells))


def plain_name(text: str) -> str:
    """A column's name without capitals and repeated blanks."""
    return " ".join(text.split()).casefold()


def text_of(file: Path) -> str:
    """The text of a file: UTF-8 or UTF-16 with their marks, else Windows' western European.

    Raises:
        DataError: it cannot be read, is too large, or is no text.
    """
    raw = read_bytes(file, _MOST_BYTES)
    for encoding in ("utf-16",) if raw[:2] in _BYTE_ORDER_MARKS else ("utf-8-sig", "cp1252", "latin-1"):
        try:
            text = raw.decode(encoding)
        except UnicodeError:
            continue
        if "\x00" in text:
            raise DataError(f"{file}: contains zero bytes, so it is not text; export the strokes as CSV")
        return text
    raise DataError(f"{file}: begins like UTF-16 text and is none; is the file cut off?")


def grids(file: Path, text: str) -> list[CellGrid]:
    """The file split at commas, semicolons and tabs; delimiters that it does not contain are skipped."""
    return [_grid(file, text, delimiter) for delimiter in _DELIMITERS if delimiter in text[:_HEAD]]


def _grid(file: Path, text: str, delimiter: str) -> CellGrid:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True)
    lines, cells = [], []
    try:
        for row in reader:
            lines.append(reader.line_num)
            cells.append([cell.strip() for cell in row])
    except csv.Error as error:
        raise DataError(f"{file}:{reader.line_num}: cannot be split into cells ({error})") from error
    return CellGrid(file, tuple(lines), tuple(cells))
