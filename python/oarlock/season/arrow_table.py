"""Reads Parquet files of a season as Arrow tables, with a readable error for damaged files and those too large."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from oarlock.storage.errors import DataError
from oarlock.storage.parquet_table import ALWAYS_READ_BYTES, EXPANSION
from oarlock.storage.regular_file import open_regular, shown_bytes

# Names of columns that are no UTF-8 come as UnicodeDecodeError.
_UNREADABLE = (OSError, pa.ArrowException, TypeError, UnicodeDecodeError)
_MOST_TEXT_BYTES = 2**30
_NUMBER_BYTES = 8
_BATCH_VALUES = 2**22


def read_table(
    file: Path | bytes,
    advice: str = "",
    where: str = "",
    columns: Sequence[str] | None = None,
    without_lists: bool = False,
) -> pa.Table:
    """All columns, or those that are named. Texts stay dictionary-encoded.

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
