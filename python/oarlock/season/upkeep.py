"""`check` compares every file of a season with its hash; `repair` and `prune` remove what can go."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, TypeVar

from oarlock.season.arrow_table import read_table
from oarlock.season.records import (
    ENTRY_FILE,
    RUN_FILE,
    STROKES_FILE,
    athlete_folder,
    recording_folder,
    result_folder,
)
from oarlock.season.storage import OWN_WORK
from oarlock.season.store import Season, in_threads
from oarlock.season.tables import AthleteData, catalogue, update_tables
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import TEMPORARY

What: TypeAlias = Literal["damaged", "missing", "unfinished", "unknown"]
Record = TypeVar("Record")
Progress: TypeAlias = Callable[[float], None]
_LEFT_S = 3600.0
"""A folder without its commit record is a stopped writer's if nothing was written into it for so long."""
_STOPPED = "its writer was stopped, or is still at work"


@dataclass(frozen=True)
class FileFault:
    """A fault of a file or folder; an unfinished one only takes space."""

    what: What
    name: str
    words: str

    @property
    def is_damage(self) -> bool:
        """Whether data are lost."""
        return self.what in ("damaged", "missing")

    @property
    def is_repairable(self) -> bool:
        """Whether `repair` removes it, so that it is made again: a result, or a table of strokes."""
        parts = self.name.split("/")
        return self.is_damage and (parts[1] == "results" or parts[1:] == [STROKES_FILE])


def check(season: Season, progress: Progress = lambda share: None) -> list[FileFault]:
    """All faults of a season; empty if it is in order. Every file is read; `progress` gets the share done, 0 to 1."""
    found: list[FileFault] = []
    folders = season.folders()
    owners: dict[str, str] = {}
    for done, athlete in enumerate(folders, start=1):
        found += _athlete(season, athlete)
        for name in season.recordings_of(athlete):
            if (other := owners.setdefault(name, athlete)) != athlete:
                words = f"is also a recording of {other}: remove one of the two folders by hand"
                found.append(FileFault("unknown", recording_folder(athlete, name), words))
        progress(done / len(folders))
    return found + list(_setups(season, "", ""))


def _athlete(season: Season, athlete: str) -> list[FileFault]:
    folder, found = athlete_folder(athlete), list[FileFault]()
    try:
        one = season.athlete(athlete)
    except DataError as error:
        return [FileFault("damaged", f"{folder}/athlete.toml", str(error))]
    if one is None:
        words = (
            f"an erasure was interrupted: `oarlock season erase SEASON --athlete {athlete} --yes` continues"
        )
        return [FileFault("unfinished", folder, words)]
    recordings, results = season.recordings_of(athlete), season.results_of(athlete)
    jobs = [lambda name=name: list(_recording(season, athlete, name)) for name in recordings]
    jobs += [lambda pair=pair: list(_result(season, athlete, pair, recordings)) for pair in results]
    for own in in_threads(lambda job: job(), jobs):
        found += own
    found += _setups(season, f"{folder}/", athlete)
    table = AthleteData(one, "").file
    try:
        read_table(season.place.read(table), "; `--repair` makes it again", season.where(table))
    except FileNotFoundError:
        pass  # the next question makes it
    except (DataError, OSError) as error:
        found.append(FileFault("damaged", table, str(error)))
    left = season.place.children(f"{folder}/{OWN_WORK}")
    return found + [FileFault("unfinished", f"{folder}/{OWN_WORK}/{name}", _STOPPED) for name in left]


def _recording(season: Season, athlete: str, name: str) -> Iterator[FileFault]:
    folder = recording_folder(athlete, name)
    entry = yield from _record(season.entry, (athlete, name), f"{folder}/{ENTRY_FILE}")
    if entry is not None:
        if (entry.athlete, entry.recording) != (athlete, name):
            words = f"{ENTRY_FILE} names the recording {entry.recording} of {entry.athlete}"
            yield FileFault("damaged", folder, words)
        yield from _files(season, folder, entry.files, ENTRY_FILE)


def _result(
    season: Season, athlete: str, result: tuple[str, str], recordings: Sequence[str]
) -> Iterator[FileFault]:
    folder = result_folder(athlete, *result)
    record = yield from _record(season.run_record, (athlete, *result), f"{folder}/{RUN_FILE}")
    if record is not None:
        if result[0] not in recordings:
            words = "belongs to a recording that is not here; `season prune` removes it"
            yield FileFault("unknown", folder, words)
        yield from _files(season, folder, record.files, RUN_FILE)


def _record(
    read: Callable[..., Record | None], name: Sequence[str], file: str
) -> Generator[FileFault, None, Record | None]:
    """The commit record of a folder; None, and why, if it is damaged or not there."""
    try:
        record = read(*name)
    except DataError as error:
        yield FileFault("damaged", file, str(error))
        return None
    if record is None:
        folder, _, own = file.rpartition("/")
        yield FileFault("unfinished", folder, f"has no {own}: {_STOPPED}")
    return record


def _files(season: Season, folder: str, files: Mapping[str, str], record: str) -> Iterator[FileFault]:
    for name, expected in files.items():
        full = f"{folder}/{name}"
        try:
            found = hashlib.sha256(season.place.read(full)).hexdigest()
        except FileNotFoundError:
            advice = "is missing; add or compute it again, or restore it from a backup"
            yield FileFault("missing", full, advice)
            continue
        if found != expected:
            yield FileFault("damaged", full, f"has the hash {found[:12]}, expected {expected[:12]}")
    for full, _ in season.place.files(folder):
        own = full.removeprefix(f"{folder}/")
        if own != record and own not in files:
            yield FileFault("unknown", full, f"is not in {record}")


def _setups(season: Season, top: str, athlete: str) -> Iterator[FileFault]:
    for name in season.place.children(f"{top}setups"):
        try:
            season.load_setup(name, athlete)
        except DataError as error:
            yield FileFault("damaged", f"{top}setups/{name}", str(error))


def repair(season: Season, faults: Sequence[FileFault]) -> list[str]:
    """Remove damaged results and tables, which can be made again; recordings are never touched.

    Returns:
        Names of what was removed.
    """
    removed = set()
    for fault in faults:
        if not fault.is_repairable:
            continue
        name = "/".join(fault.name.split("/")[:3])
        if "/results/" in name:
            season.place.remove_folder(name, RUN_FILE)
        else:
            season.place.remove([name])
        removed.add(name)
    return sorted(removed)


@dataclass(frozen=True)
class Pruned:
    """Something that is removed, why, and its size."""

    folder: str
    why: str
    bytes: int


def prune(season: Season, today: datetime.date, dry_run: bool = True) -> list[Pruned]:
    """Find superseded runs, what ended its retention before today, and what stopped writers left; and remove it."""
    found = []
    for one in catalogue(season).of:
        name = one.athlete.pseudonym
        found += [
            *_unfinished(season, name),
            *_superseded(season, name, one),
            *_ended(season, name, one, today),
        ]
    if not dry_run:
        for pruned in found:
            _remove(season, pruned)
        update_tables(season)
    return found


def _unfinished(season: Season, athlete: str) -> Iterator[Pruned]:
    place, top = season.place, athlete_folder(athlete)
    folders = [f"{top}/{OWN_WORK}/{name}" for name in place.children(f"{top}/{OWN_WORK}")]
    for kind, record in (("recordings", ENTRY_FILE), ("results", RUN_FILE)):
        names = (f"{top}/{kind}/{name}" for name in place.children(f"{top}/{kind}"))
        folders += [folder for folder in names if not place.exists(f"{folder}/{record}")]
    files = {folder: list(place.files(folder)) for folder in folders}
    files |= {name: [(name, size)] for name, size in place.files(top) if _is_temporary(name)}
    for folder, own in files.items():
        if all(place.age_s(name) > _LEFT_S for name, _ in own):
            why = "was left unfinished by a writer that was stopped"
            yield Pruned(folder, why, sum(size for _, size in own))


def _is_temporary(name: str) -> bool:
    return name.rpartition("/")[2].startswith(TEMPORARY)


def _superseded(season: Season, athlete: str, data: AthleteData) -> Iterator[Pruned]:
    current = data.current()
    for recording, run in season.results_of(athlete):
        folder = result_folder(athlete, recording, run)
        if recording not in data.entries:
            yield Pruned(folder, "belongs to a recording that is not here", _size(season, folder))
        elif recording in current and current[recording].run != run:
            why = f"is superseded by run {current[recording].run}"
            yield Pruned(folder, why, _size(season, folder))


def _ended(season: Season, athlete: str, data: AthleteData, today: datetime.date) -> Iterator[Pruned]:
    results = season.results_of(athlete)
    for what, months in season.retention.items():
        whole = today.year * 12 + today.month - 1 - months
        first = datetime.date(whole // 12, whole % 12 + 1, 1)
        for entry in data.entries.values():
            if entry.start is None or entry.start.date() >= first:
                continue
            folders = [entry.folder]
            if what == "results":
                folders = [result_folder(athlete, *one) for one in results if one[0] == entry.recording]
            why = f"began on {entry.start:%Y-%m-%d}; retention of {what} is {months} months"
            for folder in folders:
                if size := _size(season, folder):
                    yield Pruned(folder, why, size)


def _remove(season: Season, pruned: Pruned) -> None:
    """Remove a folder; of a recording that was whole its entry stays, so that its strokes keep it."""
    if _is_temporary(pruned.folder):
        return season.place.remove([pruned.folder])
    top, kind, name = pruned.folder.split("/")
    entry = season.entry(top.partition("=")[2], name) if kind == "recordings" else None
    if entry is None:
        return season.place.remove_folder(pruned.folder, RUN_FILE if kind == "results" else "")
    season.place.write(f"{pruned.folder}/{ENTRY_FILE}", replace(entry, files={}).toml())
    return season.place.remove([f"{pruned.folder}/{file}" for file in entry.files])


def _size(season: Season, folder: str) -> int:
    """Bytes of a folder without its commit record."""
    files = season.place.files(folder)
    return sum(size for name, size in files if not name.endswith((f"/{ENTRY_FILE}", f"/{RUN_FILE}")))
