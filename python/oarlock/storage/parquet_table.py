"""Reads Parquet files for tracks and recordings, with a readable error for damaged files and for those too large."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular, shown_bytes

# Names of columns that are no UTF-8 come as UnicodeDecodeError.
_UNREADABLE = (OSError, pa.ArrowException, UnicodeDecodeError)
_NUMBER_BYTES = 8
EXPANSION = 100
"""Decoded bytes for each byte of the file, at most. Recordings and tracks have less than 10; equal rows any number."""
ALWAYS_READ_BYTES = 2**28
"""So many decoded bytes are read whatever the size of the file: constant signals are small."""


def read_table(file: Path, advice: str = "") -> pa.Table:
    """The whole file. Texts stay indices into the different ones.

    Raises:
        DataError: it is not there, no Parquet, or unpacks to far more than any recording would; with `advice`.
    """
    try:
        with open_regular(file) as stream:
            size = stream.seek(0, 2)
            source = parquet.ParquetFile(stream)
            _check_size(file, source, size)
            texts = [name for name in source.schema_arrow.names if _is_text(source.schema_arrow.field(name))]
            table = parquet.ParquetFile(stream, read_dictionary=texts).read()
            _ = table.column_names  # decoded only when asked for
            return table
    except DataError:
        raise
    except _UNREADABLE as error:
        raise DataError(f"{file}: cannot be read as Parquet ({error}){advice}") from error


@contextmanager
def columns_of(file: Path, advice: str = "") -> Iterator[None]:
    """Context in which missing columns and columns of a wrong type raise a DataError that names this file."""
    try:
        yield
    except DataError:
        raise
    except KeyError as missing:
        raise DataError(f"{file}: column {missing} is missing; the file is damaged{advice}") from None
    except (ValueError, TypeError, AttributeError, pa.ArrowException) as error:
        raise DataError(
            f"{file}: a column has the wrong type ({error}); the file is damaged{advice}"
        ) from None


def _check_size(file: Path, source: parquet.ParquetFile, size_bytes: int) -> None:
    """The footer says how many values the columns have, before one of them is decoded."""
    about = source.metadata
    values = sum(
        about.row_group(group).column(column).num_values
        for group in range(about.num_row_groups)
        for column in range(about.num_columns)
    )
    decoded = _NUMBER_BYTES * max(values, about.num_rows)
    if decoded > max(ALWAYS_READ_BYTES, EXPANSION * size_bytes):
        raise DataError(
            f"{file}: has {shown_bytes(size_bytes)} and would unpack to {shown_bytes(decoded)} "
            f"({about.num_rows:,} rows). No measured signal is so regular: the file is damaged, or not a recording. "
            "If it is one, save it as CSV, or in parts."
        )


def _is_text(field: pa.Field) -> bool:
    kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
    return bool(pa.types.is_string(kind) or pa.types.is_binary(kind) or pa.types.is_large_string(kind))
