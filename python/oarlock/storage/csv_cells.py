"""Cells of CSV files that a spreadsheet takes for text, whatever a name contains; all writers of CSV use it."""

from __future__ import annotations

import re
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

_STARTS_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def inert(text: str) -> str:
    """The text with an apostrophe before it if a spreadsheet would run it as a formula; numbers stay as they are."""
    return f"'{text}" if text.startswith(_STARTS_FORMULA) and not _NUMBER.fullmatch(text) else text


def write_csv(table: pa.Table, file: Path) -> None:
    """Write an Arrow table; names of columns and texts that would run as formulas become inert."""
    columns = [_inert_column(column) for column in table.columns]
    csv.write_csv(pa.table(columns, names=[inert(name) for name in table.column_names]), file)


def _inert_column(column: pa.ChunkedArray) -> pa.ChunkedArray | pa.Array:
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        return column
    return pa.array([None if text is None else inert(text) for text in column.to_pylist()], type=pa.string())
