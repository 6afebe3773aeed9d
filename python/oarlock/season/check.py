"""`check`: compares every file of a season with its hash and names what is damaged, unfinished, or should be gone."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, TypeAlias

from oarlock.season.arrow_table import read_table
from oarlock.season.compact import Current
from oarlock.season.layout import (
    ATHLETES,
    CURRENT_FILE,
    ENTRY_FILE,
    RESULTS,
    RUN_FILE,
    SETUPS,
    TABLES,
    recording_folder,
    result_folder,
)
from oarlock.season.place import OWN_WORK
from oarlock.season.store import Season
from oarlock.storage.errors import DataError

What: TypeAlias = Literal["damaged", "missing", "unfinished", "erased", "unknown"]
Told: TypeAlias = Callable[[float], None]
_READERS = 8


@dataclass(frozen=True)
class FileFault:
    """Something that is not as it should be.

    Args:
        what: damaged or missing files lose data; unfinished ones are left of a writer that was stopped, and cost space
            only; erased ones came back from a backup.
        name: of the file or folder.
        words: a sentence.
    """

    what: What
    name: str
    words: str

    @property
    def is_damage(self) -> bool:
        """Whether data are lost, or data of an erased athlete are there."""
        return self.what in ("damaged", "missing", "erased")


def check(season: Season, told: Told = lambda share: None) -> list[FileFault]:
    """All findings of a season; empty if it is in order. Every file is read.

    Args:
        season: which.
        told: called with the share done, 0 to 1.
    """
    recordings, results = season.recordings(), season.results()
    erased = season.erased()
    jobs = [lambda name=name: list(_recording(season, name, erased)) for name in recordings]
    jobs += [lambda one=one: list(_result(season, one[0], one[1], set(recordings))) for one in results]
    found: list[FileFault] = []
    with ThreadPoolExecutor(_READERS) as pool:
        for done, own in enumerate(pool.map(lambda job: job(), jobs), start=1):
            found += own
            told(done / len(jobs))
    found += _setups(season)
    found += _tables(season)
    found += _came_back(season, erased)
    found += [
        FileFault(
            "unfinished", f"{OWN_WORK}/{name}", "left by a writer that was stopped, or is still at work"
        )
        for name in season.place.children(OWN_WORK)
    ]
    return found


def _recording(season: Season, name: str, erased: frozenset[str]) -> Iterator[FileFault]:
    folder = recording_folder(name)
    try:
        entry = season.entry(name)
    except DataError as error:
        yield FileFault("damaged", f"{folder}/{ENTRY_FILE}", str(error))
        return
    if entry is None:
        yield FileFault(
            "unfinished", folder, f"has no {ENTRY_FILE}: its writer was stopped, or is still at work"
        )
        return
    if entry.recording != name:
        yield FileFault(
            "damaged", folder, f"its name differs from the one in {ENTRY_FILE}, {entry.recording}"
        )
    if season.is_erased(entry.athlete, erased):
        yield FileFault("erased", folder, _erased(entry.athlete))
    yield from _files(season, folder, entry.files, ENTRY_FILE)


def _result(season: Season, recording: str, run: str, recordings: set[str]) -> Iterator[FileFault]:
    folder = result_folder(recording, run)
    try:
        record = season.run_record(recording, run)
    except DataError as error:
        yield FileFault("damaged", f"{folder}/{RUN_FILE}", str(error))
        return
    if record is None:
        yield FileFault(
            "unfinished", folder, f"has no {RUN_FILE}: its writer was stopped, or is still at work"
        )
        return
    if recording not in recordings:
        yield FileFault(
            "unknown", folder, "belongs to a recording that is not here; `season prune` removes it"
        )
    yield from _files(season, folder, record.files, RUN_FILE)


def _files(season: Season, folder: str, files: Mapping[str, str], record: str) -> Iterator[FileFault]:
    for name, expected in files.items():
        full = f"{folder}/{name}"
        try:
            found = hashlib.sha256(season.place.read(full)).hexdigest()
        except FileNotFoundError:
            yield FileFault(
                "missing", full, "is missing; add or compute it again, or restore it from a backup"
            )
            continue
        if found != expected:
            yield FileFault("damaged", full, f"has the hash {found[:12]}, expected {expected[:12]}")
    for full, _ in season.place.files(f"{folder}/".rstrip("/")):
        own = full.removeprefix(f"{folder}/")
        if own != record and own not in files:
            yield FileFault("unknown", full, f"is not in {record}")


def _came_back(season: Season, erased: frozenset[str]) -> Iterator[FileFault]:
    """What of erased athletes came back, other than recordings: their files, and rows of tables."""
    if not erased:
        return
    for file in season.place.children(ATHLETES):
        if season.is_erased(athlete := file.removesuffix(".toml"), erased):
            yield FileFault("erased", f"{ATHLETES}/{file}", _erased(athlete))
    for name, _ in season.place.files(TABLES):
        for athlete in _athletes_in(season, name):
            if season.is_erased(athlete, erased):
                yield FileFault("erased", name, f"contains rows of an athlete. {_erased(athlete)}")


def _erased(athlete: str) -> str:
    again = f"`oarlock season erase SEASON --athlete {athlete} --yes`"
    return f"{athlete} was erased and came back; {again} removes it again"


def _athletes_in(season: Season, name: str) -> list[str]:
    """Athletes in a file of a table, whether the table counts or not."""
    try:
        table = read_table(season.place.read(name), columns=["athlete"])
        return list(table["athlete"].unique().to_pylist())
    except (DataError, OSError, KeyError):
        return []  # no table, or none with athletes


def _setups(season: Season) -> Iterator[FileFault]:
    for name in season.place.children(SETUPS):
        try:
            season.load_setup(name)
        except DataError as error:
            yield FileFault("damaged", f"{SETUPS}/{name}", str(error))


def _tables(season: Season) -> Iterator[FileFault]:
    try:
        current = Current.read(season)
    except DataError as error:
        yield FileFault(
            "damaged", "tables/current.toml", f"{error}; remove it, the next question makes it again"
        )
        return
    for name in current.files.values():
        try:
            read_table(
                season.place.read(name), "; `--repair` makes it again", season.where(name), without_lists=True
            )
        except FileNotFoundError:
            yield FileFault("missing", name, "is missing; the next compaction makes it again")
        except (DataError, OSError) as error:
            yield FileFault("damaged", name, str(error))


def is_repairable(finding: FileFault) -> bool:
    """Whether `repair` mends it."""
    return finding.what in ("damaged", "missing") and finding.name.startswith((f"{RESULTS}/", f"{TABLES}/"))


def repair(season: Season, findings: Sequence[FileFault]) -> list[str]:
    """Remove damaged results and tables, which can be computed again; recordings are never touched.

    Returns:
        Names of what was removed.
    """
    removed = set()
    for finding in filter(is_repairable, findings):
        top, _, rest = finding.name.partition("/")
        if top == RESULTS:
            season.place.remove_folder(folder := f"{RESULTS}/{rest.partition('/')[0]}", RUN_FILE)
            removed.add(folder)
        else:
            # Its name is the hash of what it should contain: compaction would take the damaged file for the right one.
            season.place.remove(found := [CURRENT_FILE, finding.name])
            season.place.forget_copies()
            removed.update(found)
    return sorted(removed)
