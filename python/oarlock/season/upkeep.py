"""`check` compares every file of a season with its hash; `repair` and `prune` remove what can go."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, TypeAlias

from oarlock.season.records import (
    ATHLETE_FILE,
    ENTRY_FILE,
    RUN_FILE,
    STROKES_FILE,
    Entry,
    RunRecord,
    athlete_folder,
    recording_folder,
    result_folder,
)
from oarlock.season.store import Season, in_threads
from oarlock.season.tables import AthleteData, arrow_table, catalogue, update_tables
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import TEMPORARY

What: TypeAlias = Literal["damaged", "missing", "unfinished", "unknown"]
_LEFT_S = 3600.0
"""A folder without its commit record is a stopped writer's if nothing was written into it for so long."""


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


def check(season: Season, progress: Callable[[float], None] = lambda share: None) -> list[FileFault]:
    """All faults of a season; empty if it is in order. Every file is read; `progress` gets the share done, 0 to 1."""
    faults = list[FileFault]()
    folders, owners = season.folders(), dict[str, str]()
    for done, athlete in enumerate(folders, start=1):
        faults += _athlete(season, athlete)
        for name in season.recordings_of(athlete):
            if (other := owners.setdefault(name, athlete)) != athlete:
                words = f"is also a recording of {other}: remove one of the two folders by hand"
                faults.append(FileFault("unknown", recording_folder(athlete, name), words))
        progress(done / len(folders))
    return faults + list(_setups(season, ""))


def _athlete(season: Season, athlete: str) -> list[FileFault]:
    folder = athlete_folder(athlete)
    try:
        data = season.athlete(athlete)
    except DataError as error:
        return [FileFault("damaged", f"{folder}/{ATHLETE_FILE}", str(error))]
    if data is None:
        again = f"`oarlock season erase SEASON --athlete {athlete} --yes` continues"
        return [FileFault("unfinished", folder, f"an erasure was interrupted: {again}")]
    recordings, results = season.recordings_of(athlete), season.results_of(athlete)
    checks = [
        partial(_folder, season, recording_folder(athlete, name), partial(season.entry, athlete, name))
        for name in recordings
    ]
    checks += [
        partial(_folder, season, result_folder(athlete, *names), partial(season.run_record, athlete, *names))
        for names in results
    ]
    faults = [fault for own in in_threads(lambda run: list(run()), checks) for fault in own]
    words = "belongs to a recording that is not here; `season prune` removes it"
    strays = {result_folder(athlete, *names) for names in results if names[0] not in recordings}
    strays -= {fault.name for fault in faults}
    faults += [FileFault("unknown", stray, words) for stray in sorted(strays)]
    faults += _setups(season, athlete)
    table = AthleteData(data, "").file
    try:
        arrow_table(season.place.read(table), season.where(table), "; `--repair` makes it again")
    except FileNotFoundError:
        pass  # the next question makes it
    except (DataError, OSError) as error:
        faults.append(FileFault("damaged", table, str(error)))
    return faults


def _folder(season: Season, folder: str, read: Callable[[], Entry | RunRecord | None]) -> Iterator[FileFault]:
    """The faults of a recording or a result."""
    own = ENTRY_FILE if "/recordings/" in folder else RUN_FILE
    try:
        record = read()
    except DataError as error:
        yield FileFault("damaged", f"{folder}/{own}", str(error))
        return
    if record is None:
        yield FileFault("unfinished", folder, f"has no {own}: its writer was stopped, or is still at work")
        return
    if isinstance(record, Entry) and record.folder != folder:
        yield FileFault(
            "damaged", folder, f"{own} names the recording {record.recording} of {record.athlete}"
        )
    here = {name for name, _ in season.place.files(folder)} - {f"{folder}/{own}"}
    for name, sha256 in record.files.items():
        full = f"{folder}/{name}"
        if full not in here:
            words = "is missing; add or compute it again, or restore it from a backup"
            yield FileFault("missing", full, words)
            continue
        try:
            season.read_checked(full, sha256)
        except DataError as error:
            yield FileFault("damaged", full, str(error).removeprefix(f"{full}: "))
    for full in sorted(here - {f"{folder}/{name}" for name in record.files}):
        what: What = "unfinished" if _is_temporary(full) else "unknown"
        yield FileFault(what, full, f"is not in {own}")


def _setups(season: Season, athlete: str) -> Iterator[FileFault]:
    folder = f"{athlete_folder(athlete)}/setups" if athlete else "setups"
    for name in season.place.children(folder):
        try:
            season.load_setup(name, athlete)
        except DataError as error:
            yield FileFault("damaged", f"{folder}/{name}", str(error))


def repair(season: Season, faults: Sequence[FileFault]) -> list[str]:
    """Remove damaged results and tables, which can be made again; recordings are never touched.

    Returns:
        Names of what was removed.
    """
    names = sorted({"/".join(fault.name.split("/")[:3]) for fault in faults if fault.is_repairable})
    for name in names:
        if "/results/" in name:
            season.place.remove_folder(name, RUN_FILE)
        else:
            season.place.remove([name])
    return names


@dataclass(frozen=True)
class Pruned:
    """Something that is removed, why, and its size."""

    folder: str
    why: str
    bytes: int


def prune(season: Season, today: datetime.date, dry_run: bool = True) -> list[Pruned]:
    """Find superseded runs, what ended its retention before today, and what stopped writers left; and remove it."""
    pruned = [
        each
        for data in catalogue(season).of
        for part in (_unfinished(season, data), _superseded(season, data), _ended(season, data, today))
        for each in part
    ]
    if not dry_run:
        for each in pruned:
            _remove(season, each)
        update_tables(season)
    return pruned


def _unfinished(season: Season, data: AthleteData) -> Iterator[Pruned]:
    place, top = season.place, athlete_folder(data.athlete.pseudonym)
    folders = [
        f"{top}/{kind}/{name}"
        for kind, record in (("recordings", ENTRY_FILE), ("results", RUN_FILE))
        for name in place.children(f"{top}/{kind}")
        if not place.exists(f"{top}/{kind}/{name}/{record}")
    ]
    files = {folder: list(place.files(folder)) for folder in folders}
    files |= {name: [(name, size)] for name, size in place.files(top) if _is_temporary(name)}
    for folder, own in files.items():
        if all((place.age_s(name) or 0.0) > _LEFT_S for name, _ in own):
            why = "was left unfinished by a writer that was stopped"
            yield Pruned(folder, why, sum(size for _, size in own))


def _is_temporary(name: str) -> bool:
    return name.rpartition("/")[2].startswith(TEMPORARY)


def _superseded(season: Season, data: AthleteData) -> Iterator[Pruned]:
    athlete, current = data.athlete.pseudonym, data.current()
    for recording, run in season.results_of(athlete):
        folder, why = result_folder(athlete, recording, run), ""
        if recording not in data.entries:
            why = "belongs to a recording that is not here"
        elif recording in current and current[recording].run != run:
            why = f"is superseded by run {current[recording].run}"
        if why and season.place.exists(f"{folder}/{RUN_FILE}"):  # else a writer may be at work
            yield Pruned(folder, why, _size(season, folder))


def _ended(season: Season, data: AthleteData, today: datetime.date) -> Iterator[Pruned]:
    athlete = data.athlete.pseudonym
    results = season.results_of(athlete)
    for what, months in season.retention.items():
        year, month = divmod(today.year * 12 + today.month - 1 - months, 12)
        for entry in data.entries.values():
            if entry.start is None or entry.start.date() >= datetime.date(year, month + 1, 1):
                continue
            folders = [entry.folder]
            if what == "results":
                folders = [result_folder(athlete, *names) for names in results if names[0] == entry.recording]
            why = f"began on {entry.start:%Y-%m-%d}; retention of {what} is {months} months"
            sizes = ((folder, _size(season, folder)) for folder in folders)
            yield from (Pruned(folder, why, size) for folder, size in sizes if size)


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
