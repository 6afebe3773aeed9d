"""Reads files only if they are regular and within a limit of size, for every reader of the package."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import TextIO

from oarlock.storage.errors import DataError

TEXT_LIMIT_BYTES = 8 * 2**20
"""The largest TOML file that is read, in 10 s. A model has 10 kB, a calibration 100 kB."""
LINE_LIMIT_BYTES = 2**20
TABLE_LIMIT_BYTES = 2 * 2**30
"""The largest file that is read into memory as a whole, other than Parquet."""


class UnreadableFileError(DataError):
    """A file that the system does not open; `__cause__` is the system's error."""


def open_regular(file: Path) -> io.BufferedReader:
    """The file, open for reading bytes.

    Raises:
        UnreadableFileError: it cannot be opened.
        DataError: it is a folder, a pipe, a socket or a device, whose end may never come.
    """
    try:
        # O_NONBLOCK: the opening of a pipe that nobody writes to would not return.
        number = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError) as error:  # a zero byte in a path is a ValueError
        raise UnreadableFileError(
            f"{file}: cannot be read ({getattr(error, 'strerror', None) or error})"
        ) from error
    try:
        mode = os.fstat(number).st_mode
        if not stat.S_ISREG(mode):
            kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
            kind = kinds.get(stat.S_IFMT(mode), "a device")
            raise DataError(f"{file}: is {kind}, not a regular file. Copy its contents into a file first.")
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def open_text(file: Path, encoding: str) -> TextIO:
    """The file, open for reading lines as they are; their ends are kept for `csv`.

    Raises:
        LookupError: the encoding is not known.
        DataError: as `open_regular`, or the first line does not end within `LINE_LIMIT_BYTES`.
    """
    stream = open_regular(file)
    try:
        start = stream.read(LINE_LIMIT_BYTES)
        if len(start) == LINE_LIMIT_BYTES and b"\n" not in start and b"\r" not in start:
            raise DataError(
                f"{file}: has no line end in its first {shown_bytes(LINE_LIMIT_BYTES)}; it is no table of text"
            )
        stream.seek(0)
        return io.TextIOWrapper(stream, encoding=encoding, newline="")
    except BaseException:
        stream.close()
        raise


def read_bytes(file: Path, limit_bytes: int = TABLE_LIMIT_BYTES) -> bytes:
    """The contents of a regular file.

    Raises:
        DataError: as `open_regular`, or it is larger than the limit.
    """
    with open_regular(file) as stream:
        size = os.fstat(stream.fileno()).st_size
        # Not `read(limit_bytes + 1)`, which takes that memory first. Files of the system have more than their size.
        found = stream.read(size + 1) if size <= limit_bytes else b""
        while len(found) <= limit_bytes and (more := stream.read(LINE_LIMIT_BYTES)):
            found += more
    if max(size, len(found)) > limit_bytes:
        raise DataError(
            f"{file}: has {shown_bytes(max(size, len(found)))}, more than the {shown_bytes(limit_bytes)} that are "
            "read of such a file. Is it the right one?"
        )
    return found


def read_text(file: Path, encoding: str = "utf-8") -> str:
    """The text of a regular file of at most `TEXT_LIMIT_BYTES`, with plain line ends.

    Raises:
        DataError: as `open_regular`, or it is too large, or of another encoding.
    """
    try:
        text = read_bytes(file, TEXT_LIMIT_BYTES).decode(encoding)
    except UnicodeDecodeError as error:
        raise DataError(f"{file}: is not UTF-8 text (byte {error.start}). Save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def begins_with(file: Path, mark: bytes, at: int = 0) -> bool:
    """Whether a file has these bytes at a place near its beginning; False if it cannot be read."""
    try:
        with open_regular(file) as stream:
            return stream.read(at + len(mark))[at:] == mark
    except (OSError, DataError):
        return False


def shown_bytes(count: float) -> str:
    """A size for people, such as 4.0 GB."""
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:,.1f} {unit}"
    return f"{count:.0f} bytes"
