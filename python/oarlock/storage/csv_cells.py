"""CSV files of plain columns, read and written by the engine, and cells that a spreadsheet takes for text.

`delimited` reads tables of any other layout.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from oarlock import _core
from oarlock.storage.arrays import Floats
from oarlock.storage.parquet_table import Column, Texts
from oarlock.storage.regular_file import UnreadableFileError, read_bytes

_STARTS_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def inert(text: str) -> str:
    """The text with an apostrophe before it if a spreadsheet would run it as a formula; numbers stay as they are."""
    return f"'{text}" if text.startswith(_STARTS_FORMULA) and not _NUMBER.fullmatch(text) else text


def write_csv(columns: Mapping[str, Column], file: Path) -> None:
    """Write columns; names and texts that would run as formulas become inert.

    Numbers have all their digits; a cell is empty where a number or a text is missing.

    Raises:
        OSError: the file cannot be written.
    """
    _core.write_csv(file, {inert(name): _inert(column) for name, column in columns.items()})


def _inert(column: Column) -> Column:
    if isinstance(column, Texts):
        return Texts(column.places, [inert(word) for word in column.words])
    return column


def plain_columns(file: Path, names: Sequence[str]) -> dict[str, Floats] | None:
    """The columns of a comma-separated file with this header, (T,) each; NaN where a cell is empty or NaN.

    None where anything else is in the file: `delimited` then reads it, or says which line is wrong. Numbers are the
    nearest doubles, as `float` reads them.
    """
    try:
        columns = _core.read_csv(read_bytes(file), list(names))
    except UnreadableFileError:
        return None
    return None if columns is None else dict(zip(names, columns, strict=True))
