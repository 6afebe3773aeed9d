"""The log of a session: each event as a line of JSON, beside the packets."""

from __future__ import annotations

import json
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

FILE = "events.jsonl"
MOST_LINES = 10_000
"""That are written again if somebody removes the file."""


class EventLog:
    """Appends events to the log of a folder; a full disk costs lines, never the session.

    Args:
        folder: of the session; it exists.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._file = self._path.open("a", encoding="utf-8", buffering=1)

    def write(self, time_s: float, text: str) -> None:
        """Adds a line."""
        # Work of another process may end after the session.
        with suppress(OSError, ValueError):
            line = json.dumps({"time_s": round(time_s, 2), "text": text}) + "\n"
            self._lines.append(line)
            self._file.write(line)

    def close(self) -> None:
        """Closes the file; writes it again if somebody removed it."""
        with suppress(OSError):
            self._file.close()
        if not self._path.exists():
            with suppress(OSError):
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._path.write_text("".join(self._lines), encoding="utf-8")


def read_events(folder: Path) -> list[dict[str, Any]]:
    """The events of a session, `time_s` and `text`; a line that a kill cut is left out."""
    found = []
    for line in (folder / FILE).read_text(encoding="utf-8").splitlines():
        with suppress(ValueError):
            found.append(json.loads(line))
    return found
