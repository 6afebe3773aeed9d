"""`Season`: athletes, recordings, results and setups of one place; `create_season` and `open_season`.

An athlete is in the season while the athlete's file is there. An erasure removes that file first and lists the folder
last; whoever stores something looks for the file afterwards. So one of the two removes what is stored meanwhile.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from oarlock.season.athletes import Athlete
from oarlock.season.object_storage import open_storage
from oarlock.season.records import (
    ATHLETE_FILE,
    ENTRY_FILE,
    RUN_FILE,
    SEASON_FILE,
    Entry,
    RunRecord,
    Setup,
    athlete_folder,
    parsed_toml,
    recording_folder,
    result_folder,
)
from oarlock.season.storage import OWN_WORK, SeasonStorage
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable, toml_text

READERS = 16
"""Threads that read small files: on an object store each waits for its answer."""
_FORMAT = 1
_PREFIX = athlete_folder("")
Item = TypeVar("Item")
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Season:
    """One season.

    Args:
        id: random; the same in every copy of the season.
        time_zone: of local times without a zone, such as Europe/Berlin.
        retention: months after which `prune` removes something, by what: ``raw`` or ``results``.
        setup: name of the setup of all athletes without one of their own; empty if none was chosen.
    """

    place: SeasonStorage
    name: str
    id: str
    time_zone: str = "UTC"
    retention: Mapping[str, int] = field(default_factory=dict)
    setup: str = ""

    # ---- athletes

    def folders(self) -> list[str]:
        """Pseudonyms of which there is a folder, of an interrupted erasure too."""
        names = self.place.children("")
        return [name.removeprefix(_PREFIX) for name in names if name.startswith(_PREFIX)]

    def athletes(self) -> dict[str, Athlete]:
        """All athletes by pseudonym."""
        found = in_threads(self.athlete, self.folders())
        return {one.pseudonym: one for one in found if one is not None}

    def athlete(self, pseudonym: str) -> Athlete | None:
        """One athlete; None if nobody has this pseudonym, or the athlete was erased."""
        file = f"{athlete_folder(pseudonym)}/{ATHLETE_FILE}"
        try:
            return Athlete.parsed(self.place.read(file), pseudonym, self.where(file))
        except FileNotFoundError:
            return None

    def put_athlete(self, athlete: Athlete) -> None:
        """Store an athlete, or what changed about one."""
        self.place.write(f"{athlete_folder(athlete.pseudonym)}/{ATHLETE_FILE}", athlete.toml())

    def is_here(self, athlete: str) -> bool:
        """Whether this athlete is in the season; to be asked after something was stored."""
        return self.place.exists(f"{athlete_folder(athlete)}/{ATHLETE_FILE}")

    def write(self, athlete: str, name: str, contents: bytes) -> bool:
        """Write or replace a file in an athlete's folder; False if the athlete was erased meanwhile."""
        file = f"{athlete_folder(athlete)}/{name}"
        fault = None
        try:
            self.place.write(file, contents)
        except DataError as error:  # perhaps because an erasure removes the folder
            fault = error
        if self.is_here(athlete):
            if fault is not None:
                raise fault
            return True
        self.place.remove([file])
        self.place.remove_empty(athlete_folder(athlete))
        return False

    def _put(self, athlete: str, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        """As `SeasonStorage.put_folder`, in an athlete's folder."""
        try:
            is_new, fault = self.place.put_folder(folder, files, record), None
        except DataError as error:  # perhaps because the erasure removed what was half written
            is_new, fault = True, error
        if self.is_here(athlete):
            if fault is not None:
                raise fault
            return is_new
        if is_new:
            self.place.remove_folder(folder, record)
        self.place.remove_folder(f"{athlete_folder(athlete)}/{OWN_WORK}")
        self.place.remove_empty(athlete_folder(athlete))
        raise ErasedError(f"{athlete} was erased from this season meanwhile; {folder} was not stored")

    # ---- recordings and results

    def recordings(self) -> dict[str, str]:
        """The athlete of each recording, finished or not, by its name."""
        here = self.folders()
        found = in_threads(lambda name: self.recordings_of(name) if self.is_here(name) else [], here)
        return {recording: athlete for athlete, own in zip(here, found, strict=True) for recording in own}

    def recordings_of(self, athlete: str) -> list[str]:
        """Names of an athlete's recordings, finished or not."""
        return self.place.children(f"{athlete_folder(athlete)}/recordings")

    def results_of(self, athlete: str) -> list[tuple[str, str]]:
        """Recording and run of an athlete's results, finished or not."""
        named = (name.partition(".") for name in self.place.children(f"{athlete_folder(athlete)}/results"))
        return [(recording, run) for recording, dot, run in named if dot]

    def entry(self, athlete: str, recording: str) -> Entry | None:
        """What is known of a recording; None if it is not there, or not yet as a whole."""
        file = f"{recording_folder(athlete, recording)}/{ENTRY_FILE}"
        try:
            return Entry.parsed(self.place.read(file), self.where(file))
        except FileNotFoundError:
            return None

    def run_record(self, athlete: str, recording: str, run: str) -> RunRecord | None:
        """How a run ended; None if it has not."""
        file = f"{result_folder(athlete, recording, run)}/{RUN_FILE}"
        try:
            return RunRecord.parsed(self.place.read(file), self.where(file))
        except FileNotFoundError:
            return None

    def entries(self, athlete: str, recordings: Iterable[str]) -> Iterator[Entry]:
        """The entries of these, without those that are unfinished or damaged; `check` names the damaged."""
        return _readable(lambda name: self.entry(athlete, name), list(recordings))

    def run_records(self, athlete: str, results: Iterable[tuple[str, str]]) -> Iterator[RunRecord]:
        """The records of these, without those that are unfinished or damaged; `check` names the damaged."""
        return _readable(lambda name: self.run_record(athlete, *name), list(results))

    def put_recording(self, entry: Entry, files: Mapping[str, bytes]) -> Entry | None:
        """Store the files of a recording; returns the entry with their hashes, None if it was there."""
        hashes = {name: hashlib.sha256(contents).hexdigest() for name, contents in files.items()}
        whole = replace(entry, files=hashes)
        is_new = self._put(entry.athlete, entry.folder, {**files, ENTRY_FILE: whole.toml()}, ENTRY_FILE)
        return whole if is_new else None

    def put_result(
        self,
        athlete: str,
        record: RunRecord,
        files: Mapping[str, bytes],
        setup: Setup,
        *,
        replaces: bool = False,
    ) -> bool:
        """Store a result with its setup; False if it was there, or the athlete was erased meanwhile.

        `replaces` removes the one that is there.
        """
        folder = result_folder(athlete, record.recording, record.run)
        if replaces:
            self.place.remove_folder(folder, RUN_FILE)
        try:
            self.put_setup(setup, athlete)
            return self._put(athlete, folder, {**files, RUN_FILE: record.toml()}, RUN_FILE)
        except ErasedError:
            return False

    # ---- setups

    def put_setup(self, setup: Setup, athlete: str = "") -> str:
        """Store the files of a setup, of everybody or of an athlete; returns its name."""
        for name, contents in setup.files.items():
            file = f"setups/{setup.name}/{name}"
            if not athlete and not self.place.exists(file):
                self.place.write(file, contents)
            elif athlete and not self.place.exists(f"{athlete_folder(athlete)}/{file}"):
                self.write(athlete, file, contents)
        return setup.name

    def load_setup(self, name: str, athlete: str = "") -> Setup:
        """A setup that was stored, of an athlete or else of everybody."""
        for top in (f"{athlete_folder(athlete)}/", "") if athlete else ("",):
            folder, found = f"{top}setups/{name}", {}
            for file in self.place.children(folder):
                key = file.removesuffix(".toml")
                if key in ("model", "calibration", "settings"):
                    found[key] = self.place.read(f"{folder}/{file}")
            if (setup := Setup(**found)).name == name:
                return setup
        raise DataError(
            f"{self.where(folder)}: is damaged or missing. Store it again with the same model, calibration and "
            "settings: `oarlock season setup`"
        )

    # ---- its own file

    def where(self, name: str) -> str:
        """The full name of a file, for an error."""
        return f"{self.place.address}/{name}"

    def toml(self) -> bytes:
        """The contents of `season.toml`."""
        head = {"format": _FORMAT, "name": self.name, "id": self.id, "time_zone": self.time_zone}
        retention = {f"{what}_months": n for what, n in self.retention.items()}
        return toml_text({**head, "setup": self.setup, "retention": retention}).encode()

    def zone(self) -> ZoneInfo:
        """The zone of local times."""
        return checked_zone(self.time_zone, self.where(SEASON_FILE))


class ErasedError(DataError):
    """An athlete was erased while something of the athlete was stored."""


def create_season(address: str, name: str, time_zone: str = "UTC") -> Season:
    """Begin a season at an address: a folder, a share, or an object store such as `s3://bucket/season`.

    Raises:
        DataError: there is a season already, other files are there, or the zone is unknown.
    """
    checked_zone(time_zone, address)
    place = open_storage(address)
    if place.exists(SEASON_FILE):
        raise DataError(f"{address}: is a season already; `oarlock season list {address}` shows it")
    if (others := place.children(""))[:1] and others != [".oarlock"]:
        raise DataError(f"{address}: holds other files, such as {others[0]}; choose an empty place")
    season = Season(place, name, secrets.token_hex(8), time_zone)
    place.write(SEASON_FILE, season.toml())
    return season


def open_season(address: str) -> Season:
    """The season at an address.

    Raises:
        DataError: there is none, or its season.toml is damaged.
    """
    place = open_storage(address)
    where = f"{place.address}/{SEASON_FILE}"
    try:
        table = parsed_toml(place.read(SEASON_FILE), where)
    except FileNotFoundError:
        raise DataError(
            f"{address}: is not a season. To begin one: `oarlock season init {address}`"
        ) from None
    table.check_keys(("format", "name", "id", "time_zone", "retention", "setup"))
    table.check_format(_FORMAT)
    return Season(
        place,
        table.string("name"),
        table.string("id"),
        table.string("time_zone", "UTC"),
        _retention(table.table("retention", {})),
        table.string("setup", ""),
    )


def not_in_season(what: str, name: str, known: Iterable[str]) -> DataError:
    """The error for a name that a season does not have; `what` says of what."""
    return DataError(f'this season has no {what} "{name}". {did_you_mean(name, sorted(known))}')


def checked_zone(name: str, where: str) -> ZoneInfo:
    """The zone of a name."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise DataError(
            f'{where}: "{name}" is no time zone; expected one such as Europe/Berlin or UTC'
        ) from None


def in_threads(read: Callable[[Item], Answer], items: Sequence[Item]) -> list[Answer]:
    """The answers to all items, in their order, by `READERS` threads."""
    if len(items) < 2:
        return [read(one) for one in items]
    with ThreadPoolExecutor(READERS) as pool:
        return list(pool.map(read, items))


def _readable(read: Callable[[Item], Answer | None], items: Sequence[Item]) -> Iterator[Answer]:
    def found(item: Item) -> Answer | None:
        with suppress(DataError):
            return read(item)
        return None

    return (one for one in in_threads(found, items) if one is not None)


def _retention(table: TomlTable) -> dict[str, int]:
    table.check_keys(("raw_months", "results_months"))
    read = partial(table.integer, default=0)
    return {key.removesuffix("_months"): read(key) for key in table.values}
