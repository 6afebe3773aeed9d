"""`RunLog`: a file of JSON lines for each `season run`: which recording was computed when, where and for how long.

Results hold none of this, so that they are the same bytes wherever they were computed.
"""

from __future__ import annotations

import datetime
import json
import os
import secrets
import socket
import time

from oarlock.season.layout import LOGS
from oarlock.season.run.job import Ended, Loss
from oarlock.season.store import Season

_WRITTEN_EVERY_S = 5.0


class RunLog:
    """The log of one run. It is written every few seconds as a whole, because an object store cannot append.

    Args:
        season: where.
    """

    def __init__(self, season: Season) -> None:
        self._season = season
        now = datetime.datetime.now(datetime.UTC)
        self.name = f"{LOGS}/run-{now:%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}.jsonl"
        self._lines: list[tuple[str, str]] = []
        self._written_s = -_WRITTEN_EVERY_S

    def say(self, event: str, **about: object) -> None:
        """Add a line: what happened, with the time, this host and the id of this process."""
        self._add(event, {"host": socket.gethostname(), "process": os.getpid(), **about})

    def ended(self, ended: Ended) -> None:
        """Add the line of a job."""
        reply = ended.reply
        about: dict[str, object] = {"recording": ended.job.recording, "run": ended.job.run}
        about |= {"host": ended.host, "process": ended.process, "seconds": round(ended.seconds, 3)}
        if isinstance(reply, Loss):
            self._add("lost", {**about, "words": reply.words, "detail": reply.detail})
        else:
            self._add(reply.told, {**about, "computed_s": round(reply.computed_s, 3), "words": reply.words})

    def write(self) -> None:
        """Write all lines but those of recordings that are not there any more, such as an erased athlete's."""
        written = None
        while (
            lines := self._of_what_is_there()
        ) != written:  # one was erased after the look before the writing
            self._season.place.write(self.name, "".join(lines).encode())
            written = lines
        self._written_s = time.monotonic()

    def _of_what_is_there(self) -> list[str]:
        there = {"", *self._season.recordings()}
        return [line for recording, line in self._lines if recording in there]

    def _add(self, event: str, about: dict[str, object]) -> None:
        at = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        line = json.dumps({"at": at, "event": event, **about}, ensure_ascii=False) + "\n"
        self._lines.append((str(about.get("recording", "")), line))
        if time.monotonic() - self._written_s > _WRITTEN_EVERY_S:
            self.write()
