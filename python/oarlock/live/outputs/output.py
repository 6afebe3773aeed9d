"""Passes what a session estimates to another program from a thread of its own, so that it never delays the session."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from oarlock.live.disk import reason_of
from oarlock.live.frame import frame_of
from oarlock.live.named_angles import LiveAngles

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.live.session import Estimate

RETRY_S = 1.0
MOST_ESTIMATES, MOST_TOLD = 200, 1000
"""What waits for an output that is slow; the oldest is left out, and counted."""
LONGEST_END_S = 2.0


@dataclass(frozen=True)
class SessionStart:
    """The session's start, from which the times of messages count.

    Args:
        monotonic_ns: by the clock of arrivals, ns.
        epoch_s: the same moment, s since 1970, UTC.
    """

    monotonic_ns: int
    epoch_s: float


class Way(Protocol):
    """How messages leave. One thread calls it, so it may wait; after an `OSError` it is opened again."""

    name: str
    """For people: "OSC to 127.0.0.1:9000"."""

    def open(self, start: SessionStart) -> None:
        """Gets ready to send; also again after a failure."""

    def send(self, message: Mapping[str, Any]) -> None:
        """Sends a frame, an event or a repetition, docs/live.md."""

    def close(self) -> None:
        """Ends it, also where it is not open."""


@dataclass
class Output:
    """Sends the messages of a session in one way, and tries again when it fails.

    Args:
        way: how they leave.
        model: of the body.
    """

    way: Way
    model: Model
    problem: str = field(init=False, default="")
    """Why nothing is sent at this time; empty if all is well."""
    sent: int = field(init=False, default=0)
    skipped: int = field(init=False, default=0)
    """Messages that were not sent, because it failed or was too slow."""

    def __post_init__(self) -> None:
        self._estimates: deque[Estimate] = deque(maxlen=MOST_ESTIMATES)
        self._told: deque[Mapping[str, Any]] = deque(maxlen=MOST_TOLD)
        self._news, self._ended = threading.Condition(), threading.Event()
        self._named = LiveAngles(self.model)
        self._thread: threading.Thread | None = None

    def start(self, start: SessionStart) -> None:
        """Begins to send.

        Raises:
            RuntimeError: the system starts no thread.
        """
        thread = threading.Thread(target=self._run, args=(start,), name=self.way.name, daemon=True)
        thread.start()
        self._thread = thread

    def put(self, estimate: Estimate) -> None:
        """Takes an estimate, and does not wait."""
        with self._news:
            if len(self._estimates) == MOST_ESTIMATES:
                self.skipped += 1
                self.problem = self.problem or "is too slow: estimates are left out"
            self._estimates.append(estimate)
            self._news.notify()

    def tell(self, message: Mapping[str, Any]) -> None:
        """Takes an event or a repetition, and does not wait."""
        with self._news:
            self.skipped += len(self._told) == MOST_TOLD
            self._told.append(message)
            self._news.notify()

    def close(self) -> None:
        """Sends what waits, and ends; a way that hangs is left alone."""
        self._ended.set()
        with self._news:
            self._news.notify()
        if self._thread is not None:
            self._thread.join(LONGEST_END_S)

    def health(self) -> dict[str, Any]:
        """How it does, for the page."""
        return {"name": self.way.name, "problem": self.problem, "sent": self.sent, "skipped": self.skipped}

    def _run(self, start: SessionStart) -> None:
        while not self._ended.is_set():
            try:
                self.way.open(start)
                self._send_all()
            except Exception as error:  # the thread must outlive it
                self.problem = reason_of(error)
                self._ended.wait(RETRY_S)
                self._leave_out()
            finally:
                self.way.close()

    def _send_all(self) -> None:
        """Until the session ends and nothing waits."""
        opened_s = time.monotonic()
        while (message := self._next()) is not None:
            try:
                self.way.send(message)
            except Exception:
                if message["type"] != "frame":
                    self._told.appendleft(message)
                raise
            self.sent += 1
            # A socket learns only with its second datagram that nobody listens.
            if time.monotonic() - opened_s > RETRY_S and len(self._estimates) < MOST_ESTIMATES // 2:
                self.problem = ""

    def _next(self) -> Mapping[str, Any] | None:
        with self._news:
            self._news.wait_for(lambda: self._told or self._estimates or self._ended.is_set())
            if self._told:
                return self._told.popleft()
            if not self._estimates:
                return None
            estimate = self._estimates.popleft()
        return frame_of(estimate, self.model, named=self._named)

    def _leave_out(self) -> None:
        """Estimates are of use at once or not at all; what happened waits."""
        with self._news:
            self.skipped += len(self._estimates)
            self._estimates.clear()
