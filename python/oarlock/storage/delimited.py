"""Reads numeric columns of delimited text for the importers. Errors name file, line and column."""

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular, open_text
from oarlock.storage.suggest import did_you_mean

MISSING_MARKERS = ("", "NaN", "---")
_ROWS_AT_ONCE = 20_000
_COMMA_DECIMAL = str.maketrans(",.", ".,")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Dialect:
    """How a delimited text file is written.

    Args:
        delimiter: one character between fields.
        decimal: "." or ",".
        encoding: as Python names it, such as "utf-8" (with or without mark), "utf-16" or "latin-1".
        skip_rows: lines before the header, or before the data where there is no header.
        header: whether a line names the columns.
        skip_after_header: lines between the header and the data, such as one of units.
        missing: texts that stand for a missing value, besides NaN.
    """

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    skip_rows: int = 0
    header: bool = True
    skip_after_header: int = 0
    missing: tuple[str, ...] = MISSING_MARKERS


@dataclass(frozen=True)
class Batch:
    """Some rows of a file.

    Args:
        lines: line number of each row, from 1.
        cells: cells[i][k] is the text of wanted column i in row k.
    """

    lines: list[int]
    cells: list[list[str]]


@dataclass(frozen=True)
class ColumnLayout:
    """Where the columns of a file stand.

    Args:
        file: the file.
        dialect: how it is written.
        names: the header's names; empty where there is no header.
        width: number of fields that each row must have.
    """

    file: Path
    dialect: Dialect
    names: tuple[str, ...]
    width: int

    @classmethod
    def of(cls, file: Path, dialect: Dialect) -> "ColumnLayout":
        """Read the header, or the first row where there is none."""
        with _opened(file, dialect) as rows:
            first = next((row for _, row in rows if row), None)
        if first is None:
            raise DataError(f"{file}: has no rows after {dialect.skip_rows} skipped lines")
        if any("\x00" in name for name in first):
            raise DataError(f'{file}: holds zero bytes; it looks like UTF-16. Set encoding = "utf-16".')
        return cls(file, dialect, tuple(n.strip() for n in first) if dialect.header else (), len(first))

    def index(self, column: str | int) -> int:
        """Position from 0 of a column given by name, or by number from 1."""
        if isinstance(column, int):
            if 1 <= column <= self.width:
                return column - 1
            raise DataError(
                f"{self.file}: has no column {column}; its rows have {self.width} fields, counted from 1"
            )
        if not self.names:
            raise DataError(
                f'{self.file}: has no header, so column "{column}" must be given by its number from 1'
            )
        found = [i for i, name in enumerate(self.names) if name == column.strip()]
        if len(found) > 1:
            numbers = " and ".join(str(i + 1) for i in found)
            raise DataError(
                f'{self.file}: column "{column}" is there {len(found)} times; give its number ({numbers})'
            )
        if not found:
            raise DataError(f'{self.file}: has no column "{column}". {self._hint(column)}')
        return found[0]

    def label(self, index: int) -> str:
        """How errors call the column at a position: by name, or by number from 1."""
        return f'column "{self.names[index]}"' if self.names else f"column {index + 1}"

    def batches(self, wanted: Sequence[int]) -> Iterator[Batch]:
        """The wanted columns, some thousand rows at a time; blank lines are passed over."""
        start = self.dialect.skip_after_header + 1 if self.dialect.header else 0
        with _opened(self.file, self.dialect) as rows:
            data = islice((numbered for numbered in rows if numbered[1]), start, None)
            while batch := [(n, self._cells(row, n, wanted)) for n, row in islice(data, _ROWS_AT_ONCE)]:
                lines, cells = zip(*batch, strict=True)
                yield Batch(list(lines), [list(column) for column in zip(*cells, strict=True)])

    def _hint(self, column: str) -> str:
        others = [d for d in ",;\t|" if d != self.dialect.delimiter and d in self.names[0]]
        if len(self.names) == 1 and others:
            return f"The header is one field; set delimiter = {others[0]!r}."
        return did_you_mean(column, self.names)

    def _cells(self, row: list[str], line: int, wanted: Sequence[int]) -> list[str]:
        if len(row) == self.width:
            return [row[i] for i in wanted]
        expected = "the header" if self.names else "the first row"
        hint = (
            "Remove the last delimiter, or add one to the header." if row[-1] == "" else "Is the row cut off?"
        )
        if len(row) > self.width and self.dialect.delimiter == "," == self.dialect.decimal:
            hint = "Decimal commas and a comma as delimiter cannot be told apart."
        raise DataError(f"{self.file}:{line}: has {len(row)} fields, {expected} has {self.width}. {hint}")


def numbers(layout: ColumnLayout, batch: Batch, position: int, index: int) -> Floats:
    """The cells of one column as float64, NaN where missing.

    Args:
        layout: the file.
        batch: the rows.
        position: place of the column among the wanted ones.
        index: place of the column in the file, from 0.

    Raises:
        DataError: A cell is no finite number; names file, line, column and the text found.
    """
    cells = batch.cells[position]
    plain = _plain_numbers(cells, layout.dialect)
    if plain is not None:
        return plain
    return np.array(
        [_number(layout, batch.lines[k], index, cell) for k, cell in enumerate(cells)], dtype=np.float64
    )


def _plain_numbers(cells: list[str], dialect: Dialect) -> Floats | None:
    """Fast path for cells that are all numbers; None where one needs a closer look."""
    text = "\n".join(cells)
    if (
        "_" in text
        or (dialect.decimal == "," and "." in text)
        or any(map(_NUMBER.fullmatch, dialect.missing))
    ):
        return None
    parts = text.replace(",", ".").split("\n") if dialect.decimal == "," else text.split("\n")
    if len(parts) != len(cells):
        return None
    try:
        values = np.fromiter(map(float, parts), dtype=np.float64, count=len(parts))
    except ValueError:
        return None
    return None if np.isinf(values).any() else values


def _number(layout: ColumnLayout, line: int, index: int, cell: str) -> float:
    dialect = layout.dialect
    text = cell.strip()
    if text in dialect.missing or text.casefold() == "nan":
        return float("nan")
    candidate = text.translate(_COMMA_DECIMAL) if dialect.decimal == "," else text
    if _NUMBER.fullmatch(candidate) and abs(value := float(candidate)) < float("inf"):
        return value
    hint = ""
    if dialect.decimal == "." and re.fullmatch(r"[+-]?\d+,\d+", text):
        hint = ' Is it a decimal comma? Set decimal = ",".'
    elif dialect.decimal == "," and "." in text:
        hint = (
            ' The decimal mark is ","; points are not read. Set decimal = "." if they are the decimal mark.'
        )
    elif text:
        hint = " If it marks a missing value, add it to missing = [...]."
    raise DataError(f'{layout.file}:{line}, {layout.label(index)}: "{text}" is not a number.{hint}')


@contextmanager
def _opened(file: Path, dialect: Dialect) -> Iterator[Iterator[tuple[int, list[str]]]]:
    """Rows with their line numbers, after the skipped lines; what goes wrong becomes a `DataError`."""
    encoding = (
        "utf-8-sig" if dialect.encoding.lower().replace("_", "-") in ("utf-8", "utf8") else dialect.encoding
    )
    try:
        with open_text(file, encoding) as stream:
            for _ in range(dialect.skip_rows):
                next(stream, None)
            reader = csv.reader(stream, delimiter=dialect.delimiter)
            yield ((reader.line_num + dialect.skip_rows, row) for row in reader)
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from error
    except LookupError as error:
        raise DataError(
            f'{file}: the encoding "{dialect.encoding}" is not known. Try "utf-8" or "latin-1".'
        ) from error
    except UnicodeError as error:
        raise DataError(
            f"{file}: is not {dialect.encoding} text ({error}). {_encoding_hint(file)}"
        ) from error
    except csv.Error as error:
        raise DataError(f"{file}: cannot be split into fields ({error})") from error


def _encoding_hint(file: Path) -> str:
    with open_regular(file) as stream:
        start = stream.read(2)
    if start in (b"\xff\xfe", b"\xfe\xff"):
        return 'It begins like UTF-16: set encoding = "utf-16".'
    return 'Set encoding, for example "latin-1", "cp1252" or "utf-16".'
