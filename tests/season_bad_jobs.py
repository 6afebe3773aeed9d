"""Tasks for tests of `season run`: recordings that end their process, hang or raise, and a count of computations.

A task travels by its name into other processes, so what it should do stands in the environment: OARLOCK_TEST_BAD, what
happens to which recording, and OARLOCK_TEST_COUNT, a file that gets a line when a computation begins and when its
result is stored.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections import Counter
from pathlib import Path

import numpy as np

from oarlock.rowing import StrokeTable
from oarlock.season import Entry, Season, Setup
from oarlock.season.compute import Compute, StrokesAndHealth, computed, fetch, run_job
from oarlock.season.run import Job, Reply

BAD, COUNT = "OARLOCK_TEST_BAD", "OARLOCK_TEST_COUNT"


def whole_task(job: Job) -> Reply:
    """The real computation, except for bad recordings."""
    return _counted(job, computed)


def quick_task(job: Job) -> Reply:
    """Strokes that follow from the recording's name, except for bad recordings."""
    return _counted(job, _quick)


def waiting_task(job: Job) -> Reply:
    """As `quick_task`, but each takes half a second."""
    time.sleep(0.5)
    return _counted(job, _quick)


def _counted(job: Job, compute: Compute) -> Reply:
    def watched(season: Season, entry: Entry, setup: Setup) -> StrokesAndHealth:
        _note("begun", job)
        _misbehave(json.loads(os.environ.get(BAD, "{}")).get(job.recording, ""))
        return compute(season, entry, setup)

    reply = run_job(job, watched)
    if reply.status in ("done", "failed"):
        _note("stored", job)
    return reply


def _quick(season: Season, entry: Entry, setup: Setup) -> StrokesAndHealth:
    with_files = Path(os.environ["TMPDIR"], entry.recording)
    fetch(season, entry, with_files)
    angle = np.array([int(entry.recording[:4], 16) / 1e5, 0.5])
    return StrokeTable({"catch_angle_rad": -angle}, source="quick"), {"trunk.nis": 1.0}


def _misbehave(how: str) -> None:
    if how == "abort":
        os.abort()
    elif how == "hang":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        time.sleep(3600.0)
    elif how == "raise":
        raise ZeroDivisionError("nothing to divide by")
    elif how == "disk full":
        raise OSError(28, "No space left on device")


def _note(what: str, job: Job) -> None:
    if file := os.environ.get(COUNT):
        with open(file, "a", encoding="ascii") as stream:  # a short line is appended as a whole
            stream.write(f"{what} {job.recording} {os.getpid()} {time.time():.3f}\n")


def begun(file: Path) -> Counter[str]:
    """How often each recording was begun."""
    return Counter(line.split()[1] for line in _lines(file) if line.startswith("begun"))


def begun_after_stored(file: Path) -> list[str]:
    """Recordings that were begun again after their result was stored."""
    stored: set[str] = set()
    again = []
    for line in _lines(file):
        what, recording, *_ = line.split()
        if what == "stored":
            stored.add(recording)
        elif recording in stored:
            again.append(recording)
    return again


def _lines(file: Path) -> list[str]:
    return file.read_text().splitlines() if file.exists() else []
