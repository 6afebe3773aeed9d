"""`prune`: removes superseded runs, what retention ends, and what stopped writers left."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import dataclass, replace

from oarlock.season.compact import Known, compact, known_now, remove_unused
from oarlock.season.layout import ENTRY_FILE, RECORDINGS, RESULTS, RUN_FILE, recording_folder, result_folder
from oarlock.season.place import OWN_WORK
from oarlock.season.store import Season

_LEFT_S = 3600.0
"""A folder without its commit record is a stopped writer's if nothing was written into it for so long."""


@dataclass(frozen=True)
class Pruned:
    """Something that is removed, why, and its size."""

    folder: str
    why: str
    bytes: int


def prune(season: Season, today: datetime.date, dry_run: bool = True) -> list[Pruned]:
    """Find what nobody needs any more, and remove it.

    Args:
        season: which.
        today: the day from which months of retention are counted back.
        dry_run: only say what would be removed.
    """
    known = known_now(season)
    found = [*_unfinished(season), *_superseded(season, known), *_ended(season, known, today)]
    if not dry_run:
        for one in found:
            _remove(season, one)
        compact(season)
        remove_unused(season, _LEFT_S)
    return found


def _unfinished(season: Season) -> Iterator[Pruned]:
    place = season.place
    folders = [f"{OWN_WORK}/{name}" for name in place.children(OWN_WORK)]
    for top, record in ((RECORDINGS, ENTRY_FILE), (RESULTS, RUN_FILE)):
        folders += [
            f"{top}/{name}" for name in place.children(top) if not place.exists(f"{top}/{name}/{record}")
        ]
    for folder in folders:
        files = list(place.files(folder))
        if all(place.age_s(name) > _LEFT_S for name, _ in files):
            yield Pruned(
                folder, "was left unfinished by a writer that was stopped", sum(size for _, size in files)
            )


def _superseded(season: Season, known: Known) -> Iterator[Pruned]:
    current = known.current(season)
    for record in known.records:
        if current[record.recording].run != record.run:
            folder = result_folder(record.recording, record.run)
            yield Pruned(
                folder, f"is superseded by run {current[record.recording].run}", _size(season, folder)
            )
    for recording, run in season.results():
        if recording not in known.entries:
            folder = result_folder(recording, run)
            yield Pruned(folder, "belongs to a recording that is not here", _size(season, folder))


def _ended(season: Season, known: Known, today: datetime.date) -> Iterator[Pruned]:
    for what, months in season.retention.items():
        first = _months_back(today, months)
        for entry in known.entries.values():
            if entry.start is None or entry.start.date() >= first:
                continue
            folders = [recording_folder(entry.recording)]
            if what == "results":
                own = (one for one in season.results() if one[0] == entry.recording)
                folders = [result_folder(*one) for one in own]
            why = f"began on {entry.start:%Y-%m-%d}; retention of {what} is {months} months"
            for folder in folders:
                if size := _size(season, folder):
                    yield Pruned(folder, why, size)


def _remove(season: Season, one: Pruned) -> None:
    """Remove a folder; of a recording that was whole its entry stays, so that its strokes are still somebody's."""
    top, _, name = one.folder.partition("/")
    entry = season.entry(name) if top == RECORDINGS else None
    if entry is None:
        season.place.remove_folder(one.folder, RUN_FILE if top == RESULTS else "")
        return
    season.place.write(f"{one.folder}/{ENTRY_FILE}", replace(entry, files={}).toml())
    season.place.remove([f"{one.folder}/{file}" for file in entry.files])


def _months_back(day: datetime.date, months: int) -> datetime.date:
    whole = day.year * 12 + day.month - 1 - months
    return datetime.date(whole // 12, whole % 12 + 1, 1)


def _size(season: Season, folder: str) -> int:
    """Bytes of a folder without its commit record."""
    files = season.place.files(folder)
    return sum(size for name, size in files if not name.endswith((f"/{ENTRY_FILE}", f"/{RUN_FILE}")))
