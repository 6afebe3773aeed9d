"""Reads Parquet files for tracks and recordings, with a readable error for damaged files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from oarlock.storage.errors import DataError

# Names of columns that are no UTF-8 come as UnicodeDecodeError.
_UNREADABLE = (OSError, pa.ArrowException, UnicodeDecodeError)


def read_table(file: Path, advice: str = "") -> pa.Table:
    """The whole file.

    Raises:
        DataError: it is not there or no Parquet, with `advice`.
    """
    try:
        table = parquet.read_table(file)
        _ = table.column_names  # decoded only when asked for
        return table
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
