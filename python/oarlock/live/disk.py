"""`SessionDisk`: the two places of a live session and what failed in them, for recorder, log and session.

What cannot be written is tried again, and after `PATIENCE_S` goes to the second place. Each failure is counted and
becomes a sentence for terminal, page and log.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, TypeVar

from oarlock.storage.errors import DataError
from oarlock.storage.write_file import sync, write_file

PATIENCE_S = 5.0
"""After so long without success the second place is used."""
TRIES, PAUSE_S = 3, 0.1
"""At the begin and at the end of a session nothing can wait for later."""
ANSWER_S = 2.0
"""A disk that takes longer for one write is named: it may be a network that hangs."""
MOST_SENTENCES = 100
SYNC = getattr(os, "fdatasync", sync)
"""macOS has no fdatasync."""
Result = TypeVar("Result")


class SessionDisk:
    """Where a session is written.

    Args:
        first: folder of the session; it is made, and made again if somebody removes it.
        second: another place, made when it is needed; None: there is none.
        files: name -> text of the files that each place needs, so that its packets can be read.
    """

    def __init__(
        self, first: Path, second: Path | None = None, files: Mapping[str, str] | None = None
    ) -> None:
        self.first, self.second, self.files = first, second, dict(files or {})
        self.failures = 0
        """How often something failed."""
        self._problems: dict[str, str] = {}
        self._failing_since_s: dict[str, float] = {}
        self._sentences: deque[str] = deque(maxlen=MOST_SENTENCES)
        self._prepared: set[Path] = set()
        self._lock = threading.Lock()
        self._asked_s = math.inf
        """When the write began that has not ended yet."""

    @property
    def problem(self) -> str:
        """What does not work at this time; empty if all is well."""
        with self._lock:
            return "; ".join(f"{what}: {problem}" for what, problem in self._problems.items())

    def news(self) -> list[str]:
        """Sentences about what has failed, and what works again, since the last call."""
        if time.monotonic() - self._asked_s > ANSWER_S:
            self.say("disk", f"has not answered for {ANSWER_S:g} s: what is received waits in memory")
        else:
            self.works("disk")
        return [self._sentences.popleft() for _ in range(len(self._sentences))]

    def prepare(self, place: Path) -> None:
        """Makes a place with its files, and those again that somebody removed.

        Raises:
            OSError, DataError: it cannot be written.
        """
        place.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            if place not in self._prepared or not (place / name).exists():
                write_file(place / name, text)
        self._prepared.add(place)

    def write(self, what: str, write: Callable[[Path], None], is_last: bool = False) -> Path:
        """Calls `write` with the first place; if that fails, and has failed for `PATIENCE_S`, with the second.

        Args:
            what: is written, for people.
            write: writes all of it, or nothing.
            is_last: there is no later call: each place is tried `TRIES` times.

        Returns: the place that has it.

        Raises:
            Exception: neither has it.
        """
        try:
            self._write(what, self.first, write, is_last)
        except Exception as error:  # whatever a file system does
            return self._write_second(what, write, error, is_last)
        self.works(what)
        return self.first

    def insist(self, what: str, work: Callable[[], Result]) -> Result:
        """What `work` returns; if the system refuses something, it is called up to `TRIES` times."""
        for left in range(TRIES - 1, -1, -1):
            try:
                result = work()
            except (OSError, RuntimeError, DataError) as error:
                if not is_failure(error):
                    raise
                self.fail(what, f"{reason_of(error)}; {'it is tried again' if left else 'it was given up'}")
                if not left:
                    raise
                time.sleep(PAUSE_S)
            else:
                break
        self.works(what)
        return result

    def fail(self, what: str, problem: str) -> None:
        """Counts a failure and says it."""
        self._count()
        self.say(what, problem)

    def say(self, what: str, problem: str) -> None:
        """Makes a sentence of a problem, unless the last one of the same thing was the same."""
        with self._lock:
            self._failing_since_s.setdefault(what, time.monotonic())
            if self._problems.get(what) != problem:
                self._problems[what] = problem
                self._sentences.append(f"{what}: {problem}")

    def works(self, what: str) -> None:
        """Ends a problem."""
        with self._lock:
            if self._problems.pop(what, None) is not None:
                del self._failing_since_s[what]
                self._sentences.append(f"{what}: works again")

    def _count(self) -> None:
        with self._lock:
            self.failures += 1

    def _write(self, what: str, place: Path, write: Callable[[Path], None], is_last: bool) -> None:
        for left in range(TRIES - 1 if is_last else 0, -1, -1):
            self._asked_s = time.monotonic()
            try:
                self.prepare(place)
                write(place)
                return
            except Exception as error:
                self._count()
                if not left:
                    raise
                self.say(what, _waits(error, place))
                time.sleep(PAUSE_S)
            finally:
                self._asked_s = math.inf

    def _write_second(
        self, what: str, write: Callable[[Path], None], error: Exception, is_last: bool
    ) -> Path:
        now_s = time.monotonic()
        is_early = now_s - self._failing_since_s.get(what, now_s) < PATIENCE_S and not is_last
        try:
            if self.second is None or is_early:
                raise error
            self._write(what, self.second, write, is_last)
        except Exception:
            self.say(what, _waits(error, self.first))
            raise
        why = f"{reason_of(error)} ({self.first})"
        self.say(what, f"recorded elsewhere: {self.second}. Nothing is lost; the reason: {why}")
        return self.second


def _waits(error: Exception, place: Path) -> str:
    why = f"{reason_of(error)} ({place})"
    return f"nothing is recorded at this time: {why}. It waits in memory until the folder can be written"


def is_failure(error: BaseException) -> bool:
    """Whether the system refused something, which it may grant later."""
    return isinstance(error, OSError | RuntimeError) or isinstance(error.__cause__, OSError)


def reason_of(error: BaseException) -> str:
    """Why, in the system's own words, without a place."""
    cause = error.__cause__ if isinstance(error.__cause__, OSError) else error
    return (cause.strerror if isinstance(cause, OSError) else "") or str(cause) or type(cause).__name__


def write_all(file: IO[bytes], content: bytes) -> None:
    """Writes to a file without a buffer, and syncs it."""
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]
    SYNC(file.fileno())
