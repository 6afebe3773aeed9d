"""Whether the recorder has room, and whether the disk is fast enough for it."""

from __future__ import annotations

import os
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from oarlock.live.disk import SYNC
from oarlock.live.doctor.check import NOTE, OK, PROBLEM, Diagnosis
from oarlock.live.recorder import PAGE_S

_PAGES, _PAGE_BYTES = 8, 256 << 10
_LEAST_BYTES, _FEW_BYTES = 200 << 20, 4 << 30
# What ten units of 100 Hz fill, with their packets' heads.
_BYTES_AN_HOUR = 10 * 100 * 150 * 3600


def disk(folder: Path, bytes_an_hour: float = _BYTES_AN_HOUR) -> list[Diagnosis]:
    """Room and speed where sessions are recorded.

    Args:
        folder: or the nearest folder above it that exists.
        bytes_an_hour: that a session writes.
    """
    place = next(p for p in (folder, *folder.resolve().parents) if p.is_dir())
    return [_room(place, bytes_an_hour), _speed(place)]


def _room(place: Path, bytes_an_hour: float) -> Diagnosis:
    free = shutil.disk_usage(place).free
    hours = free / max(bytes_an_hour, 1.0)
    text = f"{free / 1e9:,.1f} GB free at {place}, for about {hours:,.0f} hours"
    tries = ("Free some room, or give another folder with --out.",)
    if free < _LEAST_BYTES:
        return Diagnosis("disk", PROBLEM, text, tries)
    return (
        Diagnosis("disk", NOTE, text, tries)
        if free < _FEW_BYTES and hours < 24
        else Diagnosis("disk", OK, text)
    )


def _speed(place: Path) -> Diagnosis:
    """Writes pages as the recorder does, far larger than its own."""
    took_s = []
    try:
        with tempfile.TemporaryFile(dir=place) as file:
            for _ in range(_PAGES):
                began_s = time.monotonic()
                file.write(os.urandom(_PAGE_BYTES))
                file.flush()
                SYNC(file.fileno())
                took_s.append(time.monotonic() - began_s)
    except OSError as error:
        why = error.strerror or str(error)
        return Diagnosis(
            "disk", PROBLEM, f"{place} cannot be written ({why})", ("Give another folder with --out.",)
        )
    usual, worst = statistics.median(took_s), max(took_s)
    text = f"a page of {_PAGE_BYTES >> 10} KiB is on the disk after {1e3 * usual:.0f} ms, {1e3 * worst:.0f} ms at most"
    if worst < PAGE_S:
        return Diagnosis("disk", OK, text)
    return Diagnosis(
        "disk",
        NOTE,
        f"{text}; the recorder keeps what waits in memory, and a power cut would lose it",
        ("Record to the machine's own disk, not to a stick or a network folder.",),
    )
