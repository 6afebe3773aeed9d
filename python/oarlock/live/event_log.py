"""The log of a session: each event as a line of JSON, beside the packets."""

from __future__ import annotations

import json
import threading
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

from oarlock.live.disk import SessionDisk, write_all
from oarlock.storage.regular_file import read_bytes

FILE = "events.jsonl"
MOST_LINES = 10_000
"""That are written again if somebody removes the file."""


class EventLog:
    """Takes events at once, and writes them when `flush` is called, from the recorder's thread.

    Args:
        disk: of the session.
    """

    def __init__(self, disk: SessionDisk) -> None:
        self._disk = disk
        self._lines: deque[bytes] = deque(maxlen=MOST_LINES)
        self._waiting = 0
        """So many of the last lines are not on the disk."""
        self._lock = threading.Lock()

    def write(self, time_s: float, text: str) -> None:
        """Adds a line."""
        with self._lock:
            self._lines.append(json.dumps({"time_s": round(time_s, 2), "text": text}).encode() + b"\n")
            self._waiting += 1

    def flush(self, is_last: bool = False) -> None:
        """Writes the lines that wait; those that cannot be written wait on."""
        with self._lock:
            lines, waiting = list(self._lines), self._waiting
        if not waiting and not is_last:
            return
        with suppress(Exception):  # the disk has counted it
            self._disk.write("log", lambda place: _append(place / FILE, lines, waiting), is_last)
            with self._lock:
                self._waiting -= waiting

    def close(self) -> None:
        """Writes what waits, and the whole file again if somebody removed it."""
        self.flush(is_last=True)


def _append(file: Path, lines: list[bytes], waiting: int) -> None:
    """The last lines, or all of them if the file is not there; nothing of them if that fails."""
    content = b"".join(lines[max(len(lines) - waiting, 0) :] if file.exists() else lines)
    with file.open("ab", buffering=0) as stream:
        size = stream.tell()
        try:
            write_all(stream, content)
        except OSError:
            stream.truncate(size)
            raise


def read_events(folder: Path, second: Path | None = None) -> list[dict[str, Any]]:
    """The events of a session, `time_s` and `text`; a line that a kill cut is left out.

    Args:
        folder: of the session.
        second: its second place, if it may have one.
    """
    places = [place / FILE for place in (folder, second) if place is not None]
    texts = [read_bytes(file) for file in places if file.exists()]
    found = []
    for line in dict.fromkeys(b"\n".join(texts).splitlines()):
        with suppress(ValueError):
            found.append(json.loads(line))
    return sorted(found, key=lambda event: event["time_s"])
