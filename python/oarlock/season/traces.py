"""`Sought` and `traces_in`: a search for what names an athlete, in everything that a file contains."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import re
import unicodedata
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa

from oarlock.season.parquet_parts import parquet_parts
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import shown_bytes

_ID = re.compile(rb"[0-9a-f]{20,}")
_ID_LENGTH = 20
_IS_HEX = np.isin(np.arange(256), list(b"0123456789abcdef"))
_SHORT = 6
"""Names of fewer bytes would be found by chance in compressed numbers: as words of text only."""
_DEPTH = 4
_MOST_UNPACKED_BYTES = 2**28
"""Of one file with all that is packed in it: a few kilobytes can unpack to any number of bytes."""
_PACKED: tuple[tuple[bytes, str, Callable[[BinaryIO], Any]], ...] = (
    (b"\x1f\x8b", "gzip", lambda packed: gzip.GzipFile(fileobj=packed)),
    (b"BZh", "bzip2", bz2.BZ2File),
    (b"\xfd7zXZ\x00", "xz", lzma.LZMAFile),
    (b"\x28\xb5\x2f\xfd", "zstd", lambda packed: pa.CompressedInputStream(packed, "zstd")),
    (b"\x04\x22\x4d\x18", "lz4", lambda packed: pa.CompressedInputStream(packed, "lz4")),
)
_UNREADABLE = (
    pa.ArrowException,
    OSError,
    ValueError,
    EOFError,
    IndexError,
    zlib.error,
    lzma.LZMAError,
    zipfile.BadZipFile,
    DataError,
)


@dataclass(frozen=True)
class Trace:
    """Something of an athlete that was found, or a file that could not be searched.

    Args:
        file: name in the season.
        where: in the file: its name, its bytes, a column, a page, a member.
        what: the pseudonym, the name of a recording, the person's name; or why it could not be searched.
        is_unsearched: whether the file could not be searched.
    """

    file: str
    where: str
    what: str
    is_unsearched: bool = False


@dataclass(frozen=True)
class Sought:
    """What is searched for.

    Args:
        pseudonyms: as bytes, in the ways in which texts are written.
        recordings: names of recordings.
        names: names of the person, lower case, in the ways in which they are written.
        hints: parts of the names, of which one stands in all of them; empty if there is no such part.
        short: a pattern of names that are too short to be searched in numbers.
    """

    pseudonyms: tuple[bytes, ...]
    recordings: frozenset[bytes] = frozenset()
    names: tuple[bytes, ...] = ()
    hints: tuple[bytes, ...] = ()
    short: re.Pattern[bytes] | None = None

    @classmethod
    def of(cls, pseudonym: str, recordings: Iterable[str] = (), names: Sequence[str] = ()) -> Sought:
        """A search for an athlete."""
        written = sorted({way for name in names for way in _ways(name)})
        short = [re.escape(name) for name in written if len(name) < _SHORT]
        return cls(
            (pseudonym.encode(), pseudonym.encode("utf-16-le")),
            frozenset(name.encode() for name in recordings),
            tuple(name for name in written if len(name) >= _SHORT),
            _hints(names),
            re.compile(rb"(?<![a-z\x80-\xff])(?:" + b"|".join(short) + rb")(?![a-z\x80-\xff])")
            if short
            else None,
        )

    def found(self, contents: bytes, is_text: bool = True) -> str:
        """What stands there; empty if nothing does."""
        if any(one in contents for one in self.pseudonyms):
            return "the pseudonym"
        if self.recordings and _maybe_hex(contents) and any(self._recordings_in(contents)):
            return "the name of a recording"
        if self.names or self.short:
            lower = contents.lower()
            if self.hints and not any(one in lower for one in self.hints):
                return ""
            if any(one in lower for one in self.names) or (
                is_text and self.short and self.short.search(lower)
            ):
                return "the person's name"
        return ""

    def redacted(self, contents: bytes) -> bytes:
        """A text with `[erased]` in the place of what is sought."""
        for one in self.pseudonyms[:1]:
            contents = contents.replace(one, b"[erased]")
        for name in set(self._recordings_in(contents)):
            contents = contents.replace(name, b"[erased]")
        for name in self.names:
            contents = re.sub(re.escape(name), b"[erased]", contents, flags=re.IGNORECASE)
        if self.short:
            contents = re.sub(self.short.pattern, b"[erased]", contents, flags=re.IGNORECASE)
        return contents

    def _recordings_in(self, contents: bytes) -> Iterator[bytes]:
        for run in _ID.finditer(contents):
            text = run.group()
            for first in range(len(text) - _ID_LENGTH + 1):
                if (name := text[first : first + _ID_LENGTH]) in self.recordings:
                    yield name


def traces_in(name: str, contents: bytes, sought: Sought) -> list[Trace]:
    """The traces in one file: in its name, its bytes, and all that can be decoded from them."""
    found = [Trace(name, "its name", what)] if (what := sought.found(name.encode())) else []
    return found + list(_contents(name, "", contents, sought, 0, _Allowance()))


@dataclass
class _Allowance:
    """What may still be unpacked of a file."""

    left_bytes: int = _MOST_UNPACKED_BYTES

    def read(self, stream: Any) -> bytes:
        """What a stream unpacks.

        Raises:
            DataError: it is more than may be unpacked.
        """
        part = bytes(stream.read(self.left_bytes + 1))
        self.left_bytes -= len(part)
        if self.left_bytes < 0:
            raise DataError(f"unpacks to more than {shown_bytes(_MOST_UNPACKED_BYTES)}")
        return part


def _contents(
    name: str, inside: str, contents: bytes, sought: Sought, depth: int, allowance: _Allowance
) -> Iterator[Trace]:
    if what := sought.found(contents, is_text=b"\x00" not in contents[:4096]):
        yield Trace(name, f"{inside}its bytes", what)
    try:
        for where, part in _parts(contents, allowance):
            here = f"{inside}{where}"
            if where.startswith("member"):
                if depth == _DEPTH:
                    yield Trace(name, here, "is packed too deep to be searched", is_unsearched=True)
                else:
                    yield from _contents(name, f"{here}: ", part, sought, depth + 1, allowance)
            elif what := sought.found(part, is_text="number" not in where):
                yield Trace(name, here, what)
    except _UNREADABLE as error:
        first = str(error).strip().split("\n", 1)[0]
        yield Trace(name, f"{inside}its contents", f"cannot be decoded ({first})", is_unsearched=True)


def _parts(contents: bytes, allowance: _Allowance) -> Iterator[tuple[str, bytes]]:
    """What can be decoded from a file, and where."""
    if contents[:4] == b"PAR1":
        yield from parquet_parts(contents)
        return
    for magic, kind, unpack in _PACKED:
        if contents.startswith(magic):
            with unpack(io.BytesIO(contents)) as stream:
                yield f"member of {kind}", allowance.read(stream)
            return
    if contents[:2] == b"PK" or (
        b"PK\x05\x06" in contents[-66_000:] and zipfile.is_zipfile(io.BytesIO(contents))
    ):
        with zipfile.ZipFile(io.BytesIO(contents)) as archive:
            for one in archive.infolist():
                yield "names of members", one.filename.encode()
                with archive.open(one) as stream:
                    yield f"member {one.filename}", allowance.read(stream)
        return
    if b"\\u" in contents:  # letters that JSON writes as numbers
        text = contents.decode("utf-8", "replace")
        yield (
            "escaped letters",
            re.sub(r"\\u([0-9a-fA-F]{4})", lambda one: chr(int(one[1], 16)), text).encode("utf-8", "replace"),
        )


def _maybe_hex(contents: bytes) -> bool:
    """Whether 20 hexadecimal digits may stand in a row: then four multiples of 5 in a row have one."""
    if len(contents) < 4096:
        return True
    at = _IS_HEX[np.frombuffer(contents, np.uint8)[::5]]
    return bool((at[:-3] & at[1:-2] & at[2:-1] & at[3:]).any())


def _ways(name: str) -> Iterator[bytes]:
    """The ways in which a name is written, lower case: turned round, joined, decomposed, in UTF-16 and Latin-1."""
    parts = name.split()
    orders = {tuple(parts), tuple(parts[::-1])}
    texts = {joint.join(order) for order in orders for joint in (" ", "_", "-", ".", "", ", ", "%20", "+")}
    for text in texts:
        for form in ("NFC", "NFD"):
            plain = unicodedata.normalize(form, text)
            for cased in (plain, plain.lower(), plain.upper(), plain.title()):
                yield cased.encode().lower()
                yield cased.encode("utf-16-le").lower()
                yield json.dumps(cased)[1:-1].encode().lower()
                yield cased.encode("latin-1", "ignore").lower()


def _hints(names: Iterable[str]) -> tuple[bytes, ...]:
    """For each name its longest run of ASCII letters, which every way of writing it contains, also in UTF-16."""
    longest = [max(re.findall(r"[a-z]+", name.lower()) or [""], key=len) for name in names]
    if any(len(run) < 2 for run in longest):
        return ()
    return tuple(way for run in longest for way in (run.encode(), run.encode("utf-16-le")))
