"""Looks at a running session from outside: what a viewer is told, and the memory of its process."""

from __future__ import annotations

import json
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from oarlock.live.client import socket_address

_PAINTED = '{"shown": 1}'


def resident_kib(pid: int) -> int:
    """Resident memory of a process, KiB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(status.split("VmRSS:")[1].split()[0])


@dataclass
class Watcher:
    """A viewer in a thread of its own, which notes the session's memory each few seconds of the session's time.

    Args:
        url: of the page.
        pid: of the session.
        every_s: between two samples of the memory.
    """

    url: str
    pid: int
    every_s: float = 5.0
    events: list[dict[str, Any]] = field(default_factory=list)
    memory: list[tuple[float, int]] = field(default_factory=list)
    """Time of the session, s, and KiB."""
    arrivals: dict[str, int] = field(default_factory=dict)
    sources: list[dict[str, Any]] = field(default_factory=list)
    """Of the last message about the sensors' health while the session tracked."""
    frames: int = 0

    def __post_init__(self) -> None:
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def time_s(self) -> float:
        """The session's time, s, at the last look at the memory."""
        return self.memory[-1][0] if self.memory else 0.0

    def join(self) -> None:
        """Waits until the session has closed the connection."""
        self._thread.join()

    def _run(self) -> None:
        with connect(socket_address(self.url), compression=None, max_queue=4) as socket:
            try:
                for message in socket:
                    self._receive(json.loads(message), socket.send)
            except ConnectionClosed:
                return

    def _receive(self, message: dict[str, Any], send: Any) -> None:
        if message["type"] == "event":
            self.events.append(message)
        elif message["type"] == "now":
            self.frames += "frame" in message
            send(_PAINTED)
            if "health" in message:
                self._note(message["health"])

    def _note(self, health: dict[str, Any]) -> None:
        if health["is_tracking"]:
            self.arrivals, self.sources = health["arrivals"], health["sources"]
        if not self.memory or health["time_s"] >= self.memory[-1][0] + self.every_s:
            self.memory.append((health["time_s"], resident_kib(self.pid)))
