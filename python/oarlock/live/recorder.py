"""Writes every packet as it was received, so that a killed program or a power cut loses the last second at most.

A file is a sequence of pages, one each half second: a head of 12 bytes (`OARP`, length and CRC-32 of what follows,
little-endian) and the packets as an Arrow IPC stream. Each page stands for itself: a damaged one is found by its CRC,
and nothing but its own packets is lost. Packets of all sources are in one file, because their order decides the track.
"""

from __future__ import annotations

import os
import struct
import threading
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import pyarrow as pa

from oarlock.live.reading import Packet
from oarlock.storage.errors import DataError

PAGE_S = 0.25
"""A page is written and synced this often."""
FILE_BYTES = 256 << 20
"""A file that is longer is closed, and the next one begun."""
HELD_BYTES = 64 << 20
"""So much waits in memory while the disk is full; what comes then is lost and counted."""
SUFFIX = ".packets"
SYNC = getattr(os, "fdatasync", os.fsync)
"""macOS has no fdatasync."""
_MAGIC, _HEAD = b"OARP", struct.Struct("<4sII")
_SCHEMA = pa.schema(
    [
        ("source", pa.string()),
        ("address", pa.string()),
        ("channel", pa.string()),
        ("arrival_ns", pa.int64()),
        ("data", pa.binary()),
    ]
)


class Recorder:
    """Appends packets to numbered files of a folder, from a thread of its own: `write` never waits for the disk.

    Args:
        folder: made if it does not exist; files that are there stay, and the next number is taken.

    Raises:
        DataError: the folder cannot be made or written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.packets = 0
        """Packets on the disk."""
        self.lost = 0
        """Packets that found no room."""
        self.problem = ""
        """Why nothing can be written at this time; empty if all is well."""
        self._waiting: list[Packet] = []
        self._waiting_bytes = 0
        self._lock, self._ended = threading.Lock(), threading.Event()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = self._next_file()
        except OSError as error:
            raise DataError(f"{folder}: cannot be written ({error.strerror})") from error
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def write(self, packet: Packet) -> None:
        """Takes a packet; it is on the disk within a second."""
        with self._lock:
            if self._waiting_bytes > HELD_BYTES:
                self.lost += 1
                return
            self._waiting.append(packet)
            self._waiting_bytes += len(packet.data) + 64

    def close(self) -> None:
        """Writes what waits, and ends; packets for which there is no room are counted in `lost`."""
        self._ended.set()
        self._thread.join()
        self._file.close()

    def _run(self) -> None:
        while not self._ended.wait(PAGE_S):
            self._write_page()
        self._write_page()
        self.lost += len(self._waiting)

    def _write_page(self) -> None:
        with self._lock:
            page, self._waiting, self._waiting_bytes = self._waiting, [], 0
        if not page:
            return
        try:
            _append(self._file, _page(page))
            self.packets += len(page)
            self.problem = ""
            if self._file.tell() > FILE_BYTES:
                self._file.close()
                self._file = self._next_file()
        except OSError as error:
            self._keep(page, f"nothing is recorded at this time: {error.strerror} ({self.folder})")

    def _keep(self, page: list[Packet], problem: str) -> None:
        """Puts a page back that could not be written; what is torn in the file is cut off."""
        self.problem = problem
        with self._lock:
            self._waiting = page + self._waiting
            self._waiting_bytes = sum(len(p.data) + 64 for p in self._waiting)

    def _next_file(self) -> IO[bytes]:
        number = max((int(f.stem) for f in _files(self.folder)), default=0) + 1
        return (self.folder / f"{number:04d}{SUFFIX}").open("xb", buffering=0)


def _append(file: IO[bytes], page: bytes) -> None:
    """All of the page, synced, or nothing of it."""
    at = file.tell()
    try:
        rest = memoryview(page)
        while rest:
            rest = rest[file.write(rest) :]
        SYNC(file.fileno())
    except OSError:
        file.seek(at)
        file.truncate()
        raise


def _page(packets: list[Packet]) -> bytes:
    columns = [[getattr(p, name) for p in packets] for name in _SCHEMA.names]
    batch = pa.record_batch([pa.array(c, f.type) for c, f in zip(columns, _SCHEMA, strict=True)], _SCHEMA)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, _SCHEMA) as stream:
        stream.write_batch(batch)
    body = bytes(sink.getvalue())
    return _HEAD.pack(_MAGIC, len(body), zlib.crc32(body)) + body


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


def read_packets(folder: Path, damage: list[Damage] | None = None) -> Iterator[Packet]:
    """The packets of a folder in the order in which they were received.

    Args:
        folder: of a `Recorder`, finished or killed.
        damage: stretches that cannot be read are added here.

    Raises:
        DataError: the folder has no file of packets, or one cannot be read.
    """
    files = _files(folder)
    if not files:
        raise DataError(f"{folder}: has no file of packets (*{SUFFIX})")
    for file in files:
        try:
            with file.open("rb") as stream:
                yield from _packets(stream, file, [] if damage is None else damage)
        except OSError as error:
            raise DataError(f"{file}: cannot be read ({error.strerror})") from error


def _packets(stream: IO[bytes], file: Path, damage: list[Damage]) -> Iterator[Packet]:
    at = 0
    while head := stream.read(_HEAD.size):
        body = _body(stream, head)
        if body is None:
            next_at = _next_page(stream, at + 1)
            damage.append(Damage(file, at, next_at - at))
            at = next_at
            stream.seek(at)
            continue
        at = stream.tell()
        with pa.ipc.open_stream(body) as reader:
            for batch in reader:
                for row in zip(*(batch.column(n).to_pylist() for n in _SCHEMA.names), strict=True):
                    yield Packet(*row)


def _body(stream: IO[bytes], head: bytes) -> bytes | None:
    """The page behind its head; None if it is not whole. Only bytes whose CRC agrees reach Arrow's reader."""
    if len(head) < _HEAD.size:
        return None
    magic, length, crc = _HEAD.unpack(head)
    if magic != _MAGIC or length > HELD_BYTES * 2:
        return None
    body = stream.read(length)
    return body if len(body) == length and zlib.crc32(body) == crc else None


def _next_page(stream: IO[bytes], at: int) -> int:
    """Where the next whole page begins; the end of the file if there is none."""
    stream.seek(at)
    rest = stream.read()
    found = rest.find(_MAGIC)
    while found >= 0:
        stream.seek(at + found)
        if _body(stream, stream.read(_HEAD.size)) is not None:
            return at + found
        found = rest.find(_MAGIC, found + 1)
    return at + len(rest)


def _files(folder: Path) -> list[Path]:
    return sorted(f for f in folder.glob(f"*{SUFFIX}") if f.stem.isdigit())
