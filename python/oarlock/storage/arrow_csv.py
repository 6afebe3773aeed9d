"""Writes Arrow tables of studies and seasons as CSV whose cells a spreadsheet takes for text."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
from pyarrow import csv

from oarlock.storage.csv_cells import inert


def write_arrow_csv(table: pa.Table, file: Path | BinaryIO) -> None:
    """Write an Arrow table; names of columns and texts that would run as formulas become inert."""
    columns = [_inert_column(column) for column in table.columns]
    csv.write_csv(pa.table(columns, names=[inert(name) for name in table.column_names]), file)


def _inert_column(column: pa.ChunkedArray) -> pa.ChunkedArray | pa.Array:
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        return column
    return pa.array([None if text is None else inert(text) for text in column.to_pylist()], type=pa.string())
