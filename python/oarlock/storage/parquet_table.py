"""Reads every Parquet file of the package, with a readable error for damaged files and for those too large."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular, shown_bytes

# Names of columns that are no UTF-8 come as UnicodeDecodeError.
_UNREADABLE = (OSError, pa.ArrowException, TypeError, UnicodeDecodeError)
_MOST_TEXT_BYTES = 2**30
_NUMBER_BYTES = 8
_BATCH_VALUES = 2**22
EXPANSION = 100
"""Decoded bytes for each byte of the file, at most. Recordings and tracks have less than 10; equal rows any number."""
ALWAYS_READ_BYTES = 2**28
"""So many decoded bytes are read whatever the size of the file: constant signals are small."""


def read_table(
    file: Path | bytes,
    advice: str = "",
    where: str = "",
    columns: Sequence[str] | None = None,
    without_lists: bool = False,
) -> pa.Table:
    """All columns, or those that are named. Texts stay indices into the different ones.

    Args:
        file: the file, or its contents.
        advice: what to do, for errors.
        where: what errors begin with; the file.
        columns: names; those that are absent are left out. Lists and maps are read only by their names, which is
            for files that Oarlock wrote: nothing bounds them.
        without_lists: whether columns of lists and maps are left out; else they are refused.

    Raises:
        DataError: it is not there, no Parquet, or unpacks to far more than any recording would; with `advice`.
    """
    place = where or str(file)
    try:
        with io.BytesIO(file) if isinstance(file, bytes) else open_regular(file) as stream:
            size = stream.seek(0, 2)
            schema = parquet.ParquetFile(stream).schema_arrow
            texts = [field.name for field in schema if _is_text(field)]
            source = parquet.ParquetFile(stream, read_dictionary=texts)
            fields = list(source.schema_arrow)
            if columns is not None:
                wanted = [field for field in fields if field.name in columns]
            else:
                wanted = [field for field in fields if _values(field.type)]
                if len(wanted) < len(fields) and not without_lists:
                    raise TypeError("a column of lists or maps, which no recording has")
            table = pa.Table.from_batches(
                _within_bounds(place, source, wanted, size), pa.schema(wanted, source.schema_arrow.metadata)
            ).unify_dictionaries()
            _ = table.column_names, table.schema.metadata  # decoded only when asked for
            return table
    except DataError:
        raise
    except _UNREADABLE as error:
        raise DataError(f"{place}: cannot be read as Parquet ({error}){advice}") from error


def with_plain_texts(table: pa.Table, where: str) -> pa.Table:
    """The table with texts instead of indices, for what takes no indices.

    Raises:
        DataError: the texts, which a file holds once, would fill the memory; begins with `where`.
    """
    left = _MOST_TEXT_BYTES
    for place, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            for chunk in table.column(place).chunks:
                longest = max(map(len, chunk.dictionary.to_pylist()), default=0)
                left -= longest * len(chunk)
            if left < 0:
                raise DataError(
                    f"{where}: its texts unpack to more than {shown_bytes(_MOST_TEXT_BYTES)}; the file is damaged"
                )
            plain = table.column(place).cast(field.type.value_type)
            table = table.set_column(place, field.with_type(field.type.value_type), plain)
    return table


def numbers_of(column: pa.ChunkedArray) -> NDArray[Any]:
    """A column of numbers as an array, (T,); NaN where a number is missing.

    `ChunkedArray.to_numpy` would import pandas where it is installed, which takes as long as reading an hour.
    """
    array = column.combine_chunks()
    if array.null_count == 0 and (pa.types.is_floating(array.type) or pa.types.is_integer(array.type)):
        return np.from_dlpack(array)
    return np.asarray(array.to_numpy(zero_copy_only=False))


def texts_of(column: pa.ChunkedArray) -> list[str | None]:
    """The texts of a column. Equal ones are one object: a small file can repeat a long text any number of times."""
    found: list[str | None] = []
    for chunk in column.chunks:
        words = [*chunk.dictionary.to_pylist(), None] if pa.types.is_dictionary(chunk.type) else None
        rows = chunk.indices.to_pylist() if words else chunk.to_pylist()
        found += [words[-1 if row is None else row] for row in rows] if words else rows
    return found


def arrow_numbers(values: NDArray[Any]) -> pa.Array:
    """An array of numbers, (T,), as a column; without a copy where it is contiguous.

    `pa.array` and `pa.table` of numpy's arrays would import pandas where it is installed.
    """
    kind = pa.from_numpy_dtype(values.dtype)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(np.ascontiguousarray(values))])


def arrow_words(places: NDArray[np.integer], words: Sequence[str]) -> pa.DictionaryArray:
    """A column of the words at these places, (T,); those that occur are stored once, by their first rows."""
    used, first, inverse = np.unique(places, return_index=True, return_inverse=True)
    order = np.argsort(first)
    texts = [words[place].encode() for place in used[order]]
    ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
    dictionary = pa.StringArray.from_buffers(len(texts), pa.py_buffer(ends), pa.py_buffer(b"".join(texts)))
    return pa.DictionaryArray.from_arrays(
        arrow_numbers(np.argsort(order).astype(np.int32)[inverse]), dictionary
    )


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


def _within_bounds(
    where: str, source: parquet.ParquetFile, wanted: Sequence[pa.Field], size_bytes: int
) -> Iterator[pa.RecordBatch]:
    """The rows, until they are more than any recording would have.

    The footer would say how many there are, but pyarrow 26 ends the process where a damaged one is asked
    (`RowGroupMetaData.column`).
    """
    most, decoded = max(ALWAYS_READ_BYTES, EXPANSION * size_bytes), 0
    values_a_row = sum(_values(field.type) or 1 for field in wanted)
    names = [field.name for field in wanted]
    for batch in source.iter_batches(max(1, _BATCH_VALUES // max(1, values_a_row)), columns=names):
        decoded += _NUMBER_BYTES * values_a_row * batch.num_rows
        if decoded > most:
            raise DataError(
                f"{where}: has {shown_bytes(size_bytes)} and unpacks to more than {shown_bytes(most)}. "
                "No measured signal is so regular: the file is damaged, or not a recording. "
                "If it is one, save it as CSV, or in parts."
            )
        yield batch


def _values(kind: pa.DataType) -> int:
    """Values in a row of a column; 0 if their number differs from row to row, so that it bounds nothing."""
    if pa.types.is_fixed_size_list(kind):
        return int(kind.list_size)
    return 0 if pa.types.is_nested(kind) else 1


def _is_text(field: pa.Field) -> bool:
    kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
    return bool(pa.types.is_string(kind) or pa.types.is_binary(kind) or pa.types.is_large_string(kind))
