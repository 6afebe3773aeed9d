"""Everything that a Parquet file contains, as bytes that can be searched: columns, dictionaries, pages, metadata, gaps.

Statistics, key-value metadata, page headers and indices lie in the file as they are; the caller searches its bytes too.
Layout and numbers of fields: Apache Parquet, `parquet.thrift`, and Thrift's compact protocol.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from oarlock.storage.regular_file import shown_bytes

_TEXTS = ("BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY")
_CODECS = {"SNAPPY": "snappy", "GZIP": "gzip", "BROTLI": "brotli", "ZSTD": "zstd", "LZ4": "lz4_raw"}
_END = b"PAR1"
_DATA_PAGE_V2 = 3
_TYPE, _WHOLE, _PACKED, _V2 = 1, 2, 3, 8
"""Fields of a page header: kind of page, bytes before and after compression, and what pages of version 2 add."""
_DEFINITIONS, _REPETITIONS, _IS_PACKED = 5, 6, 7
_GZIP = b"\x1f\x8b\x08"
_FRAME = re.compile(re.escape(b"\x28\xb5\x2f\xfd") + b"|" + _GZIP)
"""Beginnings of zstd and gzip."""
_NO_PAGES = (ValueError, IndexError, pa.ArrowException, OSError, OverflowError, MemoryError)
SEPARATOR = b"\x00\xff\x00"
_ROWS_AT_ONCE, _MOST_BYTES = 2**16, 2**29


def parquet_parts(contents: bytes) -> Iterator[tuple[str, bytes]]:
    """Where and what: values of all columns, pages of columns of texts, metadata, and what no column claims.

    Raises:
        pa.ArrowException, OSError, ValueError: it cannot be decoded.
    """
    file = parquet.ParquetFile(pa.BufferReader(contents))
    schema = file.schema_arrow
    yield "metadata of the schema", schema.serialize().to_pybytes()
    texts = [field.name for field in schema if _is_text(field.type)]
    table = _table(file, contents, texts)
    numbers = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        buffers = SEPARATOR.join(part for chunk in column.chunks for part in _buffers(chunk))
        if pa.types.is_primitive(column.type):
            numbers.append(buffers)
        else:
            yield f"column {name}", buffers
    yield "columns of numbers", SEPARATOR.join(numbers)
    yield from _pages(file.metadata, contents)


def _table(file: Any, contents: bytes, texts: list[str]) -> pa.Table:
    """The table; columns of texts as dictionaries where their encoding allows, so that a word is searched once."""
    if texts:
        try:
            return _bounded(parquet.ParquetFile(pa.BufferReader(contents), read_dictionary=texts))
        except (pa.ArrowException, OSError):
            pass  # not every encoding can be read so
    return _bounded(file)


def _bounded(file: Any) -> pa.Table:
    batches, left = [], _MOST_BYTES
    for batch in file.iter_batches(_ROWS_AT_ONCE, use_threads=False):
        left -= batch.nbytes
        if left < 0:
            raise ValueError(f"it unpacks to more than {shown_bytes(_MOST_BYTES)}")
        batches.append(batch)
    return pa.Table.from_batches(batches, file.schema_arrow)


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_binary(kind))


def _buffers(chunk: pa.Array) -> Iterator[bytes]:
    if isinstance(chunk, pa.DictionaryArray):
        yield from _buffers(chunk.dictionary)
        return
    yield from (one.to_pybytes() for one in chunk.buffers() if one is not None)


def _pages(metadata: Any, contents: bytes) -> Iterator[tuple[str, bytes]]:
    """Pages of the columns of texts, used or not, and what lies between columns."""
    claimed = [(0, len(_END)), (len(contents) - len(_END) - 4 - _footer_length(contents), len(contents))]
    for group in range(metadata.num_row_groups):
        for number in range(metadata.num_columns):
            chunk = metadata.row_group(group).column(number)
            # An empty column has no page of data, or none at all.
            starts = [at for at in (chunk.dictionary_page_offset, chunk.data_page_offset) if at]
            if not starts:
                continue
            first = min(starts)
            end = first + chunk.total_compressed_size
            claimed.append((first, end))
            if chunk.physical_type in _TEXTS:
                codec = _CODECS.get(chunk.compression)
                for page in pages(contents[first:end], codec):
                    yield f"page of column {chunk.path_in_schema}", page
    last = 0
    for first, end in sorted(claimed):
        if first > last:
            yield from (
                (f"bytes {last} to {first}, which no column claims", part)
                for part in _gap(contents[last:first])
            )
        last = max(last, end)


def _gap(contents: bytes) -> Iterator[bytes]:
    """What a part of the file that no column claims would be as pages of each codec, and frames that begin anywhere."""
    for codec in (None, *_CODECS.values()):
        try:
            yield from pages(contents, codec)
        except _NO_PAGES:
            continue
    for frame in _FRAME.finditer(contents):
        codec = "gzip" if frame.group() == _GZIP else "zstd"
        yield _frame(contents[frame.start() :], codec)


def _frame(contents: bytes, codec: str) -> bytes:
    """What can be decompressed until the frame ends; what follows it is an error to the stream."""
    found = bytearray()
    try:
        with pa.CompressedInputStream(pa.BufferReader(contents), codec) as stream:
            while byte := stream.read(1):
                found += byte
    except _NO_PAGES:
        pass
    return bytes(found)


def pages(contents: bytes, codec: str | None) -> Iterator[bytes]:
    """The decompressed pages of one column chunk, of dictionaries too.

    Raises:
        ValueError: there are none.
    """
    at = 0
    while at < len(contents):
        header, at = _struct(contents, at)
        size, whole = header.get(_PACKED), header.get(_WHOLE)
        if not isinstance(size, int) or not isinstance(whole, int) or not 0 <= size <= len(contents) - at:
            raise ValueError("no header of a page")
        body, at = contents[at : at + size], at + size
        second = header.get(_V2) if header.get(_TYPE) == _DATA_PAGE_V2 else None
        levels = 0
        if isinstance(second, dict):
            levels = second.get(_DEFINITIONS, 0) + second.get(_REPETITIONS, 0)
            yield body[:levels]
        packed = codec is not None and (second is None or second.get(_IS_PACKED, True)) and size > levels
        yield _unpacked(body[levels:], codec, whole - levels) if packed else body[levels:]


def _unpacked(body: bytes, codec: str | None, size: int) -> bytes:
    if not 0 <= size <= _MOST_BYTES:
        raise ValueError("no size of a page")
    return bytes(pa.Codec(codec).decompress(body, size).to_pybytes())


def _footer_length(contents: bytes) -> int:
    return int.from_bytes(contents[-8:-4], "little")


# ---- Thrift's compact protocol, as far as headers of pages use it

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)


def _struct(contents: bytes, at: int) -> tuple[dict[int, Any], int]:
    fields: dict[int, Any] = {}
    number = 0
    while (head := contents[at]) != 0:
        at += 1
        kind, step = head & 15, head >> 4
        if step:
            number += step
        else:
            value, at = _varint(contents, at)
            number = (value >> 1) ^ -(value & 1)
        fields[number], at = _value(contents, at, kind)
    return fields, at + 1


def _value(contents: bytes, at: int, kind: int) -> tuple[Any, int]:
    if kind in (_TRUE, _FALSE):
        return kind == _TRUE, at
    if kind == _BYTE:
        return contents[at], at + 1
    if kind in (_I16, _I32, _I64):
        value, at = _varint(contents, at)
        return (value >> 1) ^ -(value & 1), at
    if kind == _DOUBLE:
        return None, at + 8
    if kind == _BINARY:
        size, at = _varint(contents, at)
        return contents[at : at + size], at + size
    if kind == _STRUCT:
        return _struct(contents, at)
    raise ValueError("no header of a page")


def _varint(contents: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = contents[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("no number")
