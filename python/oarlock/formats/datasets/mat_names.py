"""Names of the variables of a MATLAB file (version 5 to 7) without reading their numbers, to recognise data sets."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

_HEADER_BYTES, _TAG_BYTES, _START_BYTES = 128, 8, 1024
_MATRIX, _COMPRESSED, _STRUCTURE_CLASS = 14, 15, 2
_MOST_VARIABLES = 1000


def mat_names(file: Path) -> dict[str, tuple[str, ...]]:
    """Name of each variable, with the names of its fields if it is a structure; empty if the file is of another kind.

    The layout is that of "MAT-File Format" (The MathWorks). Damaged variables are left out: the reader reports them.
    """
    try:
        with open_regular(file) as stream:
            return dict(_variables(stream))
    except (OSError, DataError):
        return {}


def _variables(stream: BinaryIO) -> Iterator[tuple[str, tuple[str, ...]]]:
    header = stream.read(_HEADER_BYTES)
    if len(header) < _HEADER_BYTES or header[126:128] not in (b"IM", b"MI") or header[:6] != b"MATLAB":
        return
    order = "<" if header[126:128] == b"IM" else ">"
    for _ in range(_MOST_VARIABLES):
        tag = stream.read(_TAG_BYTES)
        if len(tag) < _TAG_BYTES:
            return
        kind, size = struct.unpack(f"{order}II", tag)
        start = stream.read(min(size, _START_BYTES))
        stream.seek(size - len(start), 1)
        try:
            if kind == _COMPRESSED:
                start = zlib.decompressobj().decompress(start, _START_BYTES)[_TAG_BYTES:]
            elif kind != _MATRIX:
                continue
            yield _name_and_fields(start, order)
        except (struct.error, zlib.error, UnicodeDecodeError):
            continue


def _name_and_fields(matrix: bytes, order: str) -> tuple[str, tuple[str, ...]]:
    """Name and field names at the beginning of a matrix: flags, dimensions, name, then for structures the fields."""
    flags, place = _element(matrix, 0, order)
    _, place = _element(matrix, place, order)
    name, place = _element(matrix, place, order)
    if struct.unpack(f"{order}I", flags[:4])[0] & 0xFF != _STRUCTURE_CLASS:
        return name.decode("ascii"), ()
    width_bytes, place = _element(matrix, place, order)
    names, _ = _element(matrix, place, order)
    (width,) = struct.unpack(f"{order}i", width_bytes[:4])
    if width <= 0:
        raise struct.error("no field names")
    fields = [names[i : i + width].partition(b"\0")[0].decode("ascii") for i in range(0, len(names), width)]
    return name.decode("ascii"), tuple(fields)


def _element(data: bytes, place: int, order: str) -> tuple[bytes, int]:
    """Contents of a data element, and the place of the next one. Small elements share four bytes with their tag."""
    (kind,) = struct.unpack_from(f"{order}I", data, place)
    if kind >> 16:
        return data[place + 4 : place + 4 + (kind >> 16)], place + _TAG_BYTES
    (size,) = struct.unpack_from(f"{order}I", data, place + 4)
    begin = place + _TAG_BYTES
    return data[begin : begin + size], begin + size + (-size) % _TAG_BYTES
