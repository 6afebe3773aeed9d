"""Whether a MATLAB file holds what its tags announce, asked before a library believes them.

scipy takes a tag's type for a place in a table without asking how far the table goes: one damaged byte ends the
process. So the elements are walked here first, in the order in which scipy reads them: by what classes and dimensions
promise, not by how long a matrix says that it is.

Source: MAT-File Format (MathWorks), chapter 1, version 5.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Set
from dataclasses import dataclass
from math import prod
from pathlib import Path

from oarlock.storage.errors import DataError

_HEADER = 128
_TAG = 8
_MOST_IN_TAG = 4
_ORDERS = {b"IM": "<", b"MI": ">"}
_VERSION_5, _VERSION_7_3 = 0x0100, 0x0200

_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_PLAIN = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})
"""Types of numbers and characters."""
_CELL, _STRUCTURE, _TEXT, _OPAQUE = 1, 2, 4, 17
_NUMERIC = range(6, 16)
_COMPLEX = 1 << 11
_LEAST_DIMENSIONS, _MOST_DIMENSIONS = 2, 32
_DEEPEST = 100


class _OtherClassError(Exception):
    """A matrix of a class that no reader here needs: sparse, function, object."""


class _DamagedError(Exception):
    """What is wrong, and at which byte, of what a compressed variable unfolds to where it is one."""


@dataclass(frozen=True)
class _Head:
    """What a matrix says of itself; the lowest byte of `flags` is its class."""

    flags: int
    dimensions: tuple[int, ...]
    name: str


def sound_variables(raw: bytes, file: Path) -> list[str]:
    """Names of the variables that are numbers, text, cells or structures throughout.

    Raises:
        DataError: no MATLAB file of version 5 to 7, cut off, or damaged; says where.
    """
    sound: dict[str, bool] = {}
    try:
        for walk in _variables(raw, _byte_order(raw, file)):
            head = walk.head()
            try:
                walk.content(head, 0)
            except _OtherClassError:
                sound[head.name] = False
            sound.setdefault(head.name, True)
    except (_DamagedError, zlib.error) as error:
        raise DataError(f"{file}: is damaged or cut off: {error}") from None
    return [name for name, is_sound in sound.items() if is_sound]


def _byte_order(raw: bytes, file: Path) -> str:
    order = _ORDERS.get(raw[_HEADER - 2 : _HEADER])
    if order is None or 0 in raw[:4]:
        raise DataError(
            f"{file}: is no MATLAB file of version 5 to 7, or its first {_HEADER} bytes are damaged"
        )
    (version,) = struct.unpack_from(f"{order}H", raw, _HEADER - 4)
    if version == _VERSION_7_3:
        raise DataError(f"{file}: is a MATLAB file of version 7.3. Save it again in MATLAB with -v7.")
    if version != _VERSION_5:
        raise DataError(f"{file}: is a MATLAB file of version {version:#06x}, expected {_VERSION_5:#06x}")
    return order


def _variables(raw: bytes, order: str) -> Iterator[_Walk]:
    """A walk for each variable, its first tag behind it."""
    here = _HEADER
    while here < len(raw):
        walk = _Walk(raw, order, here)
        kind, count = walk.tag()
        here += _TAG + count
        if not count or here > len(raw):
            raise _DamagedError(
                f"a variable of {count} bytes would end at {here}, the file ends at {len(raw)}"
            )
        if kind == _COMPRESSED:
            stream = zlib.decompressobj()
            content = stream.decompress(raw[here - count : here]) + stream.flush()
            walk = _Walk(content, order, 0)
            kind, _ = walk.tag()
        if kind != _MATRIX:
            raise _DamagedError(f"the variable that ends at byte {here} has type {kind}, expected {_MATRIX}")
        yield walk


class _Walk:
    """A way through the elements of one variable."""

    def __init__(self, raw: bytes, order: str, here: int) -> None:
        self._raw, self._order, self._here = memoryview(raw), order, here

    def tag(self) -> tuple[int, int]:
        """Two numbers of 32 bits: type and count of bytes, or what takes their place."""
        if self._here + _TAG > len(self._raw):
            raise _DamagedError(f"nothing stands at byte {self._here}")
        first, second = struct.unpack_from(f"{self._order}II", self._raw, self._here)
        self._here += _TAG
        return first, second

    def head(self) -> _Head:
        """Of a matrix whose tag is behind."""
        self.tag()
        flags, _ = self.tag()
        if flags & 0xFF == _OPAQUE:
            return _Head(flags, (), self._name())
        sizes = self._element({_INT32, _UINT32})
        count = len(sizes) // 4
        if not _LEAST_DIMENSIONS <= count <= _MOST_DIMENSIONS:
            raise _DamagedError(f"{count} dimensions stand before byte {self._here}")
        dimensions = struct.unpack_from(f"{self._order}{count}i", sizes)
        if min(dimensions, default=0) < 0:
            raise _DamagedError(f"dimensions {dimensions} stand before byte {self._here}")
        return _Head(flags, dimensions, self._name())

    def content(self, head: _Head, depth: int) -> None:
        """Go past what the matrix holds."""
        kind, size = head.flags & 0xFF, prod(head.dimensions)
        if kind in _NUMERIC:
            for _ in range(2 if head.flags & _COMPLEX else 1):
                self._element(_PLAIN)
            return
        if kind not in (_TEXT, _CELL, _STRUCTURE):
            raise _OtherClassError
        if size > len(self._raw):
            raise _DamagedError(f"{size} elements are announced before byte {self._here}")
        if kind == _TEXT:
            self._element(_PLAIN)
            return
        for _ in range(size * (self._fields() if kind == _STRUCTURE else 1)):
            self._matrix(depth + 1)

    def _matrix(self, depth: int) -> None:
        kind, count = self.tag()
        if kind != _MATRIX:
            raise _DamagedError(f"type {kind} stands before byte {self._here}, expected {_MATRIX}")
        if depth > _DEEPEST:
            raise _DamagedError(f"more than {_DEEPEST} matrices stand in each other at byte {self._here}")
        if count:
            self.content(self.head(), depth)

    def _fields(self) -> int:
        """How many fields each element of a structure has."""
        (length,) = struct.unpack(f"{self._order}i", self._element({_INT32, _UINT32}, 4))
        if length < 1:
            raise _DamagedError(f"names of {length} letters stand before byte {self._here}")
        return len(self._element({_INT8, _UTF8})) // int(length)

    def _name(self) -> str:
        return bytes(self._element({_INT8, _UTF8})).decode("latin-1")

    def _element(self, kinds: Set[int], expected: int | None = None) -> memoryview:
        """The bytes of an element; as many as expected if that is told."""
        begin = self._here
        kind, count = self.tag()
        here = self._here
        if kind >> 16:  # the tag itself holds the bytes
            kind, count, here = kind & 0xFFFF, kind >> 16, begin + _TAG - _MOST_IN_TAG
            if count > _MOST_IN_TAG:
                raise _DamagedError(f"the tag at byte {begin} holds {count} bytes")
        else:
            self._here += count + -count % _TAG
        if kind not in kinds:
            raise _DamagedError(f"type {kind} stands at byte {begin}, expected one of {sorted(kinds)}")
        if here + count > len(self._raw) or count != (count if expected is None else expected):
            raise _DamagedError(f"{count} bytes are announced at byte {begin}")
        return self._raw[here : here + count]
