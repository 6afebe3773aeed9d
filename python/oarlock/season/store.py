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
from oarlock.season.storage import SeasonStorage
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import toml_text

_READERS = 16
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

    def folders(self) -> list[str]:
        """Pseudonyms of which there is a folder, of an interrupted erasure too."""
        names = self.place.children("")
        return [name.removeprefix(_PREFIX) for name in names if name.startswith(_PREFIX)]

    def athletes(self) -> dict[str, Athlete]:
        """All athletes by pseudonym."""
        athletes = in_threads(self.athlete, self.folders())
        return {athlete.pseudonym: athlete for athlete in athletes if athlete is not None}

    def athlete(self, pseudonym: str) -> Athlete | None:
        """One athlete; None if nobody has this pseudonym, or the athlete was erased."""
        file = f"{athlete_folder(pseudonym)}/{ATHLETE_FILE}"
        return self._read(file, lambda contents, where: Athlete.parsed(contents, pseudonym, where))

    def put_athlete(self, athlete: Athlete) -> None:
        """Store an athlete, or what changed about one."""
        self.place.write(f"{athlete_folder(athlete.pseudonym)}/{ATHLETE_FILE}", athlete.toml())

    def is_here(self, athlete: str) -> bool:
        """Whether this athlete is in the season; to be asked after something was stored."""
        return self.place.exists(f"{athlete_folder(athlete)}/{ATHLETE_FILE}")

    def write(self, athlete: str, name: str, contents: bytes) -> None:
        """Write or replace a file in an athlete's folder.

        Raises:
            ErasedError: the athlete was erased meanwhile; the file is not there.
        """
        file = f"{athlete_folder(athlete)}/{name}"

        self._store(
            athlete, file, lambda: self.place.write(file, contents), lambda: self.place.remove([file])
        )

    def _store(
        self, athlete: str, name: str, store: Callable[[], bool | None], remove: Callable[[], None]
    ) -> bool:
        """Whether something was stored, not False; it is removed if the athlete was erased meanwhile."""
        is_new, fault = True, None
        try:
            is_new = store() is not False
        except DataError as error:  # perhaps because the erasure removed what was half written
            fault = error
        if not self.is_here(athlete):
            if is_new:
                remove()
            self.place.remove_empty(athlete_folder(athlete))
            raise ErasedError(f"{athlete} was erased from this season meanwhile; {name} was not stored")
        if fault is not None:
            raise fault
        return is_new

    def recordings(self) -> dict[str, str]:
        """The athlete of each recording, finished or not, by its name."""
        here = self.folders()
        names = in_threads(lambda name: self.recordings_of(name) if self.is_here(name) else [], here)
        return {recording: athlete for athlete, own in zip(here, names, strict=True) for recording in own}

    def recordings_of(self, athlete: str) -> list[str]:
        """Names of an athlete's recordings, finished or not."""
        return self.place.children(f"{athlete_folder(athlete)}/recordings")

    def results_of(self, athlete: str) -> list[tuple[str, str]]:
        """Recording and run of an athlete's results, finished or not."""
        named = (name.partition(".") for name in self.place.children(f"{athlete_folder(athlete)}/results"))
        return [(recording, run) for recording, dot, run in named if dot]

    def entry(self, athlete: str, recording: str) -> Entry | None:
        """What is known of a recording; None if it is not there, or not yet as a whole."""
        return self._read(f"{recording_folder(athlete, recording)}/{ENTRY_FILE}", Entry.parsed)

    def run_record(self, athlete: str, recording: str, run: str) -> RunRecord | None:
        """How a run ended; None if it has not."""
        return self._read(f"{result_folder(athlete, recording, run)}/{RUN_FILE}", RunRecord.parsed)

    def _read(self, file: str, parse: Callable[[bytes, str], Answer]) -> Answer | None:
        with suppress(FileNotFoundError):
            return parse(self.place.read(file), self.where(file))
        return None

    def entries(self, athlete: str, recordings: Iterable[str]) -> Iterator[Entry]:
        """The entries of these, without those that are unfinished or damaged; `check` names the damaged."""
        return _readable(lambda name: self.entry(athlete, name), list(recordings))

    def run_records(self, athlete: str, results: Iterable[tuple[str, str]]) -> Iterator[RunRecord]:
        """The records of these, without those that are unfinished or damaged; `check` names the damaged."""
        return _readable(lambda name: self.run_record(athlete, *name), list(results))

    def read_checked(self, name: str, sha256: str, advice: str = "") -> bytes:
        """The contents of a file of a recording or a result.

        Raises:
            DataError: it is missing or differs from its hash; with the `advice`.
        """
        try:
            contents = self.place.read(name)
        except FileNotFoundError:
            raise DataError(f"{name}: is missing{advice}") from None
        except OSError as error:
            raise DataError(f"{name}: cannot be read ({error.strerror}){advice}") from error
        if hashlib.sha256(contents).hexdigest() != sha256:
            raise DataError(f"{name}: is damaged: its SHA-256 differs from the recorded one{advice}")
        return contents

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
        with suppress(ErasedError):
            self.put_setup(setup, athlete)
            return self._put(athlete, folder, {**files, RUN_FILE: record.toml()}, RUN_FILE)
        return False

    def _put(self, athlete: str, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        return self._store(
            athlete,
            folder,
            lambda: self.place.put_folder(folder, files, record),
            lambda: self.place.remove_folder(folder, record),
        )

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
        """A setup that was stored, of an athlete or else of everybody; the empty one of exports is not stored."""
        if name == Setup().name:
            return Setup()
        for top in (f"{athlete_folder(athlete)}/", "") if athlete else ("",):
            folder = f"{top}setups/{name}"
            files = set(self.place.children(folder)) & {"model.toml", "calibration.toml", "settings.toml"}
            setup = Setup(
                **{file.removesuffix(".toml"): self.place.read(f"{folder}/{file}") for file in files}
            )
            if setup.name == name:
                return setup
        raise DataError(
            f"{self.where(folder)}: is damaged or missing. Store it again with the same model, calibration and "
            "settings: `oarlock season setup`"
        )

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
    try:
        table = parsed_toml(place.read(SEASON_FILE), f"{place.address}/{SEASON_FILE}")
    except FileNotFoundError:
        raise DataError(
            f"{address}: is not a season. To begin one: `oarlock season init {address}`"
        ) from None
    table.check_keys(("format", "name", "id", "time_zone", "retention", "setup"))
    table.check_format(_FORMAT)
    months = table.table("retention", {})
    months.check_keys(("raw_months", "results_months"))
    retention = {key.removesuffix("_months"): months.integer(key, 0) for key in months.values}
    zone, setup = table.string("time_zone", "UTC"), table.string("setup", "")
    return Season(place, table.string("name"), table.string("id"), zone, retention, setup)


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
    """The answers to all items, in their order, by `_READERS` threads."""
    if len(items) < 2:
        return [read(item) for item in items]
    with ThreadPoolExecutor(_READERS) as pool:
        return list(pool.map(read, items))


def _readable(read: Callable[[Item], Answer | None], items: Sequence[Item]) -> Iterator[Answer]:
    def answer(item: Item) -> Answer | None:
        with suppress(DataError):
            return read(item)
        return None

    return (each for each in in_threads(answer, items) if each is not None)
