"""Writes every packet as it was received, so that a killed program or a power cut loses the last second at most.

A file is a sequence of pages, one each quarter second: a head of 16 bytes (`OARP`, length and CRC-32 of what follows,
CRC-32 of these twelve bytes; little-endian) and the packets, one after the other: arrival (ns), the lengths of source,
address, channel and data, and these. Each page stands for itself: a damaged one is found by its CRC, and nothing but
its own packets is lost. Nothing but bounds of bytes decides what is read. Packets of all sources are in one file,
because their order decides the track.
"""

from __future__ import annotations

import os
import struct
import threading
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO

from oarlock.live.reading import Packet
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

PAGE_S = 0.25
"""A page is written and synced this often."""
PAGE_BYTES = 4 << 20
"""A page is not longer, unless one packet is."""
LONGEST_BYTES = 64 << 20
"""Of a page with one packet."""
FILE_BYTES = 256 << 20
"""A file that is longer is closed, and the next one begun."""
HELD_BYTES = 64 << 20
"""So much waits in memory while nothing can be written; what comes then is lost and counted."""
PATIENCE_S = 5.0
"""After so long without a page the second place is used."""
SUFFIX = ".packets"
SYNC = getattr(os, "fdatasync", os.fsync)
"""macOS has no fdatasync."""
_MAGIC, _HEAD, _CHECK, _ROW = b"OARP", struct.Struct("<4sII"), struct.Struct("<I"), struct.Struct("<qIIII")
_TEXT = "surrogatepass"
"""Addresses come from the network; half a surrogate pair must not hold up all that comes after it."""
_SEARCH_SHARE = 8
"""The search for the next page reads at most so many times the bytes that are left."""


class Recorder:
    """Appends packets to numbered files of a folder, from a thread of its own: `write` never waits for the disk.

    A page that cannot be written stays in memory and is tried again, in the folder and, after `PATIENCE_S` or at the
    end, in the second place. Numbers of files go on across both, so the files of both together are the session. A file
    that was removed while it was open is written again.

    Args:
        folder: made if it does not exist; files that are there stay, and the next number is taken.
        second: another place, made when it is needed; None: there is none.

    Raises:
        DataError: the folder cannot be made or written, or the thread not started.
    """

    def __init__(self, folder: Path, second: Path | None = None) -> None:
        self.folder, self.second = folder, second
        self.packets = 0
        """Packets on the disk."""
        self.elsewhere = 0
        """Of these, packets in the second place."""
        self.lost = 0
        """Packets that found no room."""
        self.failures = 0
        """How often a page could not be written."""
        self.problem = ""
        """Why nothing can be written in the folder at this time; empty if all is well."""
        self._waiting: list[Packet] = []
        self._waiting_bytes = 0
        self._failing_since_s: float | None = None
        self._files: dict[Path, tuple[int, IO[bytes]]] = {}
        self._newest = 0
        """Number of the file that was written last."""
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        try:
            self._open(folder)
            self._thread.start()
        except OSError as error:
            raise DataError(f"{folder}: cannot be written ({error.strerror})") from error
        except RuntimeError as error:
            self._close_files()
            raise DataError(f"{folder}: cannot be written ({error})") from error

    def write(self, packet: Packet) -> None:
        """Takes a packet; it is on the disk within a second."""
        with self._lock:
            if self._waiting_bytes > HELD_BYTES:
                self.lost += 1
                return
            self._waiting.append(packet)
            self._waiting_bytes += _size(packet)

    def close(self) -> None:
        """Writes what waits, and ends; packets for which there is no room are counted in `lost`."""
        self._ended.set()
        self._thread.join()
        self._close_files()

    def _close_files(self) -> None:
        for _, file in self._files.values():
            file.close()

    def _run(self) -> None:
        while not self._ended.wait(PAGE_S):
            self._write_pages()
        self._write_pages()
        self.lost += len(self._waiting)

    def _write_pages(self) -> None:
        while page := self._next_page():
            try:
                self._write(page)
            except Exception as error:  # the thread must outlive whatever a file system does
                with self._lock:
                    self._waiting = page + self._waiting
                    self._waiting_bytes += sum(map(_size, page))
                reason = error.strerror if isinstance(error, OSError) and error.strerror else repr(error)
                self.problem = f"nothing is recorded at this time: {reason} ({self.folder})"
                return

    def _next_page(self) -> list[Packet]:
        """Takes the oldest packets of up to `PAGE_BYTES` from those that wait."""
        with self._lock:
            size = count = 0
            for packet in self._waiting:
                size += _size(packet)
                if count and size > PAGE_BYTES:
                    size -= _size(packet)
                    break
                count += 1
            page, self._waiting = self._waiting[:count], self._waiting[count:]
            self._waiting_bytes -= size
        return page

    def _write(self, page: list[Packet]) -> None:
        content = _page(page)
        try:
            self._append(self.folder, content)
        except OSError as error:
            self.failures += 1
            now_s = time.monotonic()
            self._failing_since_s = now_s if self._failing_since_s is None else self._failing_since_s
            is_patient = now_s - self._failing_since_s < PATIENCE_S and not self._ended.is_set()
            if self.second is None or is_patient:
                raise
            self._append(self.second, content)
            self.elsewhere += len(page)
            self.problem = f"{error.strerror or error} ({self.folder}): packets are written to {self.second}"
        else:
            self._failing_since_s, self.problem = None, ""
        self.packets += len(page)

    def _append(self, place: Path, content: bytes) -> None:
        """All of the page, synced, or nothing of it."""
        number, file = self._open(place)
        at = file.tell()
        try:
            _write_all(file, content)
        except OSError:
            file.seek(at)
            file.truncate()
            raise
        self._newest = number

    def _open(self, place: Path) -> tuple[int, IO[bytes]]:
        """The file of a place; a next one if it is long enough, somebody removed it, or later packets are elsewhere."""
        removed = b""
        number, file = self._files.get(place, (0, None))
        if file is not None and _is_removed(file):
            file.seek(0)
            removed = file.read()
        elif file is not None and number >= self._newest and file.tell() <= FILE_BYTES:
            return number, file
        place.mkdir(parents=True, exist_ok=True)
        number = max([self._newest, number, *(int(f.stem) for f in _files(place))]) + 1
        path = place / f"{number:04d}{SUFFIX}"
        made = path.open("x+b", buffering=0)
        try:
            _write_all(made, removed)
        except OSError:
            made.close()
            path.unlink(missing_ok=True)
            raise
        if file is not None:
            file.close()
        self._files[place] = (number, made)
        return number, made


def _is_removed(file: IO[bytes]) -> bool:
    return os.fstat(file.fileno()).st_nlink == 0


def _write_all(file: IO[bytes], content: bytes) -> None:
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]
    SYNC(file.fileno())


def _size(packet: Packet) -> int:
    return len(packet.data) + 64


def _page(packets: list[Packet]) -> bytes:
    rows = []
    for packet in packets:
        texts = [t.encode("utf-8", _TEXT) for t in (packet.source, packet.address, packet.channel)]
        rows += [_ROW.pack(packet.arrival_ns, *map(len, texts), len(packet.data)), *texts, packet.data]
    body = b"".join(rows)
    head = _HEAD.pack(_MAGIC, len(body), zlib.crc32(body))
    return head + _CHECK.pack(zlib.crc32(head)) + body


@dataclass(frozen=True)
class Damage:
    """A stretch of a file without a whole page.

    Args:
        file: where it is.
        at_byte: where it begins.
        length: of it, bytes; what is torn at the end of the last file was being written.
    """

    file: Path
    at_byte: int
    length: int


def read_packets(
    folder: Path, damage: list[Damage] | None = None, second: Path | None = None
) -> Iterator[Packet]:
    """The packets of a folder in the order in which they were received.

    Args:
        folder: of a `Recorder`, finished or killed.
        damage: stretches that cannot be read are added here.
        second: its second place, if it may have one.

    Raises:
        DataError: the folder has no file of packets, or one cannot be read.
    """
    for file in require_packets(folder, second):
        try:
            with open_regular(file) as stream:
                yield from _packets(stream, file, [] if damage is None else damage)
        except OSError as error:
            raise DataError(f"{file}: cannot be read ({error.strerror})") from error


def require_packets(folder: Path, second: Path | None = None) -> list[Path]:
    """The files of packets of both places, in the order in which they were written.

    Raises:
        DataError: there is none.
    """
    files = _files(folder) + ([] if second is None else _files(second))
    if not files:
        raise DataError(f"{folder}: has no file of packets (*{SUFFIX})")
    return sorted(files, key=lambda file: int(file.stem))


def _packets(stream: IO[bytes], file: Path, damage: list[Damage]) -> Iterator[Packet]:
    at = 0
    while head := stream.read(_HEAD.size + _CHECK.size):
        rows = _rows(stream, head)
        if rows is None:
            next_at = _search(stream, at + 1)
            damage.append(Damage(file, at, next_at - at))
            at = next_at
            stream.seek(at)
            continue
        at = stream.tell()
        yield from rows


def _rows(stream: IO[bytes], head: bytes) -> list[Packet] | None:
    """The packets behind a head; None if the page is not whole."""
    length = _length(head)
    if length is None:
        return None
    body = stream.read(length)
    if len(body) != length or zlib.crc32(body) != _HEAD.unpack(head[: _HEAD.size])[2]:
        return None
    return _unpacked(body)


def _length(head: bytes) -> int | None:
    """Bytes of the page behind a head; None if it is no head."""
    if len(head) < _HEAD.size + _CHECK.size or not head.startswith(_MAGIC):
        return None
    own, length = head[: _HEAD.size], _HEAD.unpack(head[: _HEAD.size])[1]
    is_whole = _CHECK.unpack(head[_HEAD.size :])[0] == zlib.crc32(own)
    return length if is_whole and length <= LONGEST_BYTES else None


def _unpacked(body: bytes) -> list[Packet] | None:
    """The packets of a page; None if their lengths are not those of the page, or a text is none."""
    found, at = [], 0
    while at < len(body):
        if at + _ROW.size > len(body):
            return None
        arrival_ns, *lengths = _ROW.unpack_from(body, at)
        ends = [at := at + _ROW.size]
        for length in lengths:
            ends.append(at := at + length)
        if at > len(body):
            return None
        parts = [body[a:b] for a, b in pairwise(ends)]
        try:
            source, address, channel = (part.decode("utf-8", _TEXT) for part in parts[:3])
        except UnicodeDecodeError:
            return None
        found.append(Packet(source, address, channel, arrival_ns, parts[3]))
    return found


def _search(stream: IO[bytes], at: int) -> int:
    """Where the next whole page begins; the end of the file if none is found with a bounded number of looks."""
    stream.seek(at)
    rest = stream.read()
    budget = _SEARCH_SHARE * len(rest)
    found = rest.find(_MAGIC)
    while found >= 0 and budget > 0:
        head = rest[found : found + _HEAD.size + _CHECK.size]
        length = _length(head)
        if length is not None:
            budget -= length
            stream.seek(at + found + len(head))
            if _rows(stream, head) is not None:
                return at + found
        found = rest.find(_MAGIC, found + 1)
    return at + len(rest)


def _files(folder: Path) -> list[Path]:
    return sorted(f for f in folder.glob(f"*{SUFFIX}") if f.stem.isdigit())
