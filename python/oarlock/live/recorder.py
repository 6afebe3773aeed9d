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
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import IO

from oarlock.live.disk import TRIES, SessionDisk, write_all
from oarlock.live.reading import Packet
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular
from oarlock.storage.write_file import unwritable

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
MOST_OPEN = 64
"""Files that stay open, so that they can be written again if somebody removes them."""
PACKETS, SUFFIX = "packets", ".packets"
"""Folder within that of the session, and the end of its files' names."""
_MAGIC, _HEAD, _CHECK, _ROW = b"OARP", struct.Struct("<4sII"), struct.Struct("<I"), struct.Struct("<qIIII")
_TEXT = "surrogatepass"
"""Addresses come from the network; half a surrogate pair must not hold up all that comes after it."""
_SEARCH_SHARE = 8
"""The search for the next page reads at most so many times the bytes that are left."""


class Recorder:
    """Appends packets to numbered files, from a thread of its own: `write` never waits for the disk.

    A page that cannot be written stays in memory and is tried again, in both places of the disk. Numbers of files go on
    across both, so the files of both together are the session. Files that were removed or moved are written again.

    Args:
        disk: of the session; files that are there stay, and the next number is taken.
        beside: is called after each look for packets, as `beside()`: it writes what else waits.

    Raises:
        DataError: the folder cannot be made or written, or the thread not started.
    """

    def __init__(self, disk: SessionDisk, beside: Callable[[], None] = lambda: None) -> None:
        self.disk, self._beside = disk, beside
        self.packets = 0
        """Packets on the disk."""
        self.elsewhere = 0
        """Of these, packets in the second place."""
        self.lost = 0
        """Packets that found no room."""
        self._waiting: list[Packet] = []
        self._waiting_bytes = 0
        self._files: list[_File] = []
        self._newest = 0
        """Number of the file that was written last."""
        self._lock, self._ended = threading.Lock(), threading.Event()
        try:
            self._thread = disk.insist("recorder", self._begin)
        except OSError as error:
            raise unwritable(disk.first, error) from error
        except RuntimeError as error:
            raise DataError(f"{disk.first}: cannot be written ({error})") from error

    def write(self, packet: Packet) -> None:
        """Takes a packet; it is on the disk within a second."""
        with self._lock:
            is_full = self._waiting_bytes > HELD_BYTES
            self.lost += is_full
            if not is_full:
                self._waiting.append(packet)
                self._waiting_bytes += _size(packet)
        if is_full:
            self.disk.say("memory", f"{HELD_BYTES >> 20} MB wait for the disk: packets are lost from now on")

    def close(self) -> None:
        """Writes what waits, and ends; packets for which there is no room are counted in `lost`."""
        self._ended.set()
        self._thread.join()
        for file in self._files:
            file.close()

    def _begin(self) -> threading.Thread:
        self.disk.prepare(self.disk.first)
        self._file(self.disk.first)
        thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        try:
            thread.start()
        except RuntimeError:
            self._files.pop().close()
            raise
        return thread

    def _run(self) -> None:
        while not self._ended.wait(PAGE_S):
            self._write_pages()
            self._beside()
        self._write_pages(is_last=True)
        self.lost += len(self._waiting)

    def _write_pages(self, is_last: bool = False) -> None:
        while page := self._next_page():
            try:
                place = self.disk.write("recorder", partial(self._append, page), is_last)
            except Exception:  # the disk has counted it, and the thread must outlive it
                with self._lock:
                    self._waiting = page + self._waiting
                    self._waiting_bytes += sum(map(_size, page))
                return
            self.packets += len(page)
            self.elsewhere += len(page) if place != self.disk.first else 0
            self.disk.works("memory")

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

    def _append(self, page: list[Packet], place: Path) -> None:
        """All of the page, synced, or nothing of it."""
        for k, file in enumerate(self._files):
            if file.is_missing(place / PACKETS):
                self._files[k] = file.copy(place / PACKETS)
        file = self._file(place)
        file.append(_page(page))
        self._newest = file.number

    def _file(self, place: Path) -> _File:
        """The last file of a place; a next one if it is long enough, or if later packets are elsewhere."""
        folder = place / PACKETS
        own = [file for file in self._files if file.path.parent == folder]
        if own and own[-1].number >= self._newest and own[-1].size <= FILE_BYTES:
            return own[-1]
        folder.mkdir(exist_ok=True)
        known = (*(file.number for file in self._files), *(int(file.stem) for file in _files(folder)))
        self._files.append(_File(folder, max(known, default=0) + 1))
        if len(self._files) > MOST_OPEN:
            self._files.pop(0).close()
        return self._files[-1]


class _File:
    """A file of packets that is new in its folder and grows by whole pages."""

    def __init__(self, folder: Path, number: int) -> None:
        self.path, self.number = folder / f"{number:04d}{SUFFIX}", number
        self.size = 0
        """Bytes of whole pages; what is behind is overwritten."""
        self._unreadable = 0
        self._stream = self.path.open("x+b", buffering=0)

    def append(self, content: bytes) -> None:
        self._stream.seek(self.size)
        try:
            write_all(self._stream, content)
        except OSError:
            with suppress(OSError):
                self._stream.truncate(self.size)
            raise
        self.size += len(content)

    def close(self) -> None:
        with suppress(OSError):  # all pages are synced
            self._stream.close()

    def is_missing(self, folder: Path) -> bool:
        """Whether the file is no longer in its place; for another folder only if that is certain."""
        try:
            return not os.path.samestat(os.fstat(self._stream.fileno()), os.stat(self.path))
        except (FileNotFoundError, NotADirectoryError):
            return True
        except OSError:
            if self.path.parent == folder:
                raise
            return False

    def copy(self, folder: Path) -> _File:
        """The same pages in a folder, in place of this file."""
        folder.mkdir(exist_ok=True)
        made = _File(folder, self.number)
        try:
            self._stream.seek(0)
            while made.size < self.size and (content := self._read(self.size - made.size)):
                made.append(content)
        except OSError:
            made.close()
            with suppress(OSError):
                made.path.unlink()
            raise
        self.close()
        return made

    def _read(self, most_bytes: int) -> bytes:
        """The next bytes; none if its disk is gone for good."""
        try:
            return self._stream.read(min(most_bytes, PAGE_BYTES)) or b""
        except OSError:
            self._unreadable += 1
            if self._unreadable < TRIES:
                raise
            return b""


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
    """The packets of a session in the order in which they were received.

    Args:
        folder: of a `Recorder`, finished or killed.
        damage: stretches that cannot be read are added here.
        second: its second place, if it may have one.

    Raises:
        DataError: the folder has no file of packets, or one cannot be read.
    """
    return (packet for _, packet in numbered_packets(folder, damage, second))


def numbered_packets(
    folder: Path, damage: list[Damage] | None = None, second: Path | None = None
) -> Iterator[tuple[str, Packet]]:
    """As `read_packets`, each with its file and its number there, from 1, for people."""
    for file in packet_files(folder, second):
        with open_regular(file) as stream:
            for number, packet in enumerate(_packets(stream, file, [] if damage is None else damage), 1):
                yield f"{file}, packet {number}", packet


def packet_files(folder: Path, second: Path | None = None) -> list[Path]:
    """The files of packets of both places, in the order in which they were written.

    Raises:
        DataError: there is none, or a folder cannot be read.
    """
    try:
        files = [file for place in (folder, second) if place is not None for file in _files(place / PACKETS)]
    except OSError as error:
        raise DataError(f"{error.filename}: cannot be read ({error.strerror})") from error
    if not files:
        raise DataError(f"{folder / PACKETS}: has no file of packets (*{SUFFIX})")
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
    try:
        files = [folder / name for name in sorted(os.listdir(folder)) if name.endswith(SUFFIX)]
    except FileNotFoundError:
        return []
    return [file for file in files if file.stem.isdigit()]
