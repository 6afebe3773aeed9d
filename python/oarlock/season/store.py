"""`Season`: the entries, results, athletes and tombstones of one place."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from oarlock.season.athletes import Athlete, pseudonym_hash
from oarlock.season.entry import Entry, entry_place, parsed_toml
from oarlock.season.layout import (
    ATHLETES,
    ERASED,
    RECORDINGS,
    RESULTS,
    RUN_FILE,
    SEASON_FILE,
    SEASON_FORMAT,
    SETUPS,
    recording_folder,
    result_folder,
)
from oarlock.season.open_place import open_place
from oarlock.season.place import SeasonStorage
from oarlock.season.run_record import RunRecord, Setup
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable, toml_text

_READERS = 16
"""Threads that read small files: on an object store each waits for its answer."""
Found = TypeVar("Found")
_KEYS = ("format", "name", "id", "time_zone", "retention", "setup")


@dataclass(frozen=True)
class Season:
    """One season.

    Args:
        place: where it lies.
        name: for people.
        id: random; the same in every copy of the season.
        time_zone: of local times without a zone, such as Europe/Berlin.
        retention: months after which `prune` removes something, by what: ``raw`` or ``results``.
        setup: names of the setups that are current, by athlete; "" is for everybody else.
    """

    place: SeasonStorage
    name: str
    id: str
    time_zone: str = "UTC"
    retention: Mapping[str, int] = field(default_factory=dict)
    setup: Mapping[str, str] = field(default_factory=dict)

    # ---- entries and results

    def recordings(self) -> list[str]:
        """Names of what lies under `recordings/`, finished or not."""
        return self.place.children(RECORDINGS)

    def results(self) -> list[tuple[str, str]]:
        """Recording and run of what lies under `results/`, finished or not."""
        named = (name.partition(".") for name in self.place.children(RESULTS))
        return [(recording, run) for recording, dot, run in named if dot]

    def entry(self, recording: str) -> Entry | None:
        """What is known of a recording; None if it is not there, or not yet as a whole.

        Raises:
            DataError: its commit record is damaged.
        """
        file = entry_place(recording_folder(recording))
        try:
            return Entry.parsed(self.place.read(file), self.where(file))
        except FileNotFoundError:
            return None

    def run_record(self, recording: str, run: str) -> RunRecord | None:
        """How a run ended; None if it has not.

        Raises:
            DataError: its commit record is damaged.
        """
        file = f"{result_folder(recording, run)}/{RUN_FILE}"
        try:
            return RunRecord.parsed(self.place.read(file), self.where(file))
        except FileNotFoundError:
            return None

    def entries(self, recordings: list[str]) -> Iterator[Entry]:
        """The entries of these, without those that are unfinished or damaged; `check` names the damaged."""
        yield from self._readable(self.entry, [(name,) for name in recordings])

    def run_records(self, results: list[tuple[str, str]]) -> Iterator[RunRecord]:
        """The records of these, without those that are unfinished or damaged; `check` names the damaged."""
        yield from self._readable(self.run_record, results)

    def _readable(
        self, read: Callable[..., Found | None], names: Sequence[tuple[str, ...]]
    ) -> Iterator[Found]:
        def found(name: tuple[str, ...]) -> Found | None:
            try:
                return read(*name)
            except DataError:
                return None

        with ThreadPoolExecutor(_READERS) as pool:
            yield from (one for one in pool.map(found, names) if one is not None)

    def put_result(self, record: RunRecord, files: Mapping[str, bytes], setup: Setup) -> bool:
        """Store a result with its setup; False if it was there, or its recording was erased meanwhile."""
        self.put_setup(setup)
        folder = result_folder(record.recording, record.run)
        is_new = self.place.put_folder(folder, {**files, RUN_FILE: record.toml()}, RUN_FILE)
        # An erasure removes the entry before it looks for results: one of the two sees the other.
        if is_new and not self.place.exists(entry_place(recording_folder(record.recording))):
            self.place.remove_folder(folder, RUN_FILE)
            return False
        return is_new

    # ---- setups

    def put_setup(self, setup: Setup) -> str:
        """Store the files of a setup; returns its name."""
        for name, contents in setup.files.items():
            if not self.place.exists(file := f"{SETUPS}/{setup.name}/{name}"):
                self.place.write(file, contents)
        return setup.name

    def load_setup(self, name: str) -> Setup:
        """A setup that was stored.

        Raises:
            DataError: it is not there, or its files are others than its name says.
        """
        found = {}
        for file in self.place.children(f"{SETUPS}/{name}"):
            key = file.removesuffix(".toml")
            if key in ("model", "calibration", "settings"):
                found[key] = self.place.read(f"{SETUPS}/{name}/{file}")
        setup = Setup(**found)
        if setup.name != name:
            raise DataError(
                f"{self.where(f'{SETUPS}/{name}')}: is damaged or missing. Store it again with the same model, "
                "calibration and settings: `oarlock season setup`"
            )
        return setup

    # ---- athletes

    def athletes(self) -> dict[str, Athlete]:
        """All athletes by pseudonym."""
        names = [name for name in self.place.children(ATHLETES) if name.endswith(".toml")]
        with ThreadPoolExecutor(_READERS) as pool:
            found = pool.map(self._athlete, names)
            return {one.pseudonym: one for one in found if one is not None}

    def put_athlete(self, athlete: Athlete) -> None:
        """Store an athlete, or what changed about one.

        Raises:
            DataError: the athlete was erased.
        """
        file = f"{ATHLETES}/{athlete.pseudonym}.toml"
        self.place.write(file, athlete.toml())
        if self.is_erased_now(athlete.pseudonym):
            self.place.remove([file])
            raise DataError(
                f"{athlete.pseudonym} was erased from this season; nothing of this athlete is stored again"
            )

    def athlete(self, pseudonym: str) -> Athlete | None:
        """One athlete; None if nobody has this pseudonym."""
        return self._athlete(f"{pseudonym}.toml")

    def _athlete(self, file: str) -> Athlete | None:
        name = f"{ATHLETES}/{file}"
        try:
            return Athlete.parsed(self.place.read(name), file.removesuffix(".toml"), self.where(name))
        except FileNotFoundError:
            return None

    def erased(self) -> frozenset[str]:
        """Hashes of the pseudonyms that were erased."""
        names = self.place.children(ERASED)
        return frozenset(name.removesuffix(".toml") for name in names if name.endswith(".toml"))

    def is_erased(self, pseudonym: str, erased: frozenset[str]) -> bool:
        """Whether this athlete is among the erased."""
        return pseudonym_hash(self.id, pseudonym) in erased

    def is_erased_now(self, pseudonym: str) -> bool:
        """Whether this athlete was erased until this moment; to be asked after something was stored."""
        return self.place.exists(f"{ERASED}/{pseudonym_hash(self.id, pseudonym)}.toml")

    # ---- its own file

    def where(self, name: str) -> str:
        """The full name of a file, for an error."""
        return f"{self.place.address}/{name}"

    def toml(self) -> bytes:
        """The contents of `season.toml`."""
        tables = {"retention": {f"{what}_months": n for what, n in self.retention.items()}}
        setup = {name or "everybody": of for name, of in self.setup.items()}
        head = {"format": SEASON_FORMAT, "name": self.name, "id": self.id, "time_zone": self.time_zone}
        return toml_text({**head, **tables, "setup": setup}).encode()

    def zone(self) -> ZoneInfo:
        """The zone of local times."""
        return checked_zone(self.time_zone, self.where(SEASON_FILE))


def create_season(address: str, name: str, time_zone: str = "UTC") -> Season:
    """Begin a season at an address: a folder, a share, or an object store such as `s3://bucket/season`.

    Raises:
        DataError: there is a season already, other files are there, or the zone is unknown.
    """
    checked_zone(time_zone, address)
    place = open_place(address)
    if place.exists(SEASON_FILE):
        raise DataError(f"{address}: is a season already; `oarlock season list {address}` shows it")
    if (others := place.children(""))[:1] and others != [".oarlock"]:
        raise DataError(f"{address}: holds other files, such as {others[0]}; choose an empty place")
    season = Season(place, name, secrets.token_hex(8), time_zone, {}, {})
    place.write(SEASON_FILE, season.toml())
    return season


def open_season(address: str) -> Season:
    """The season at an address.

    Raises:
        DataError: there is none, or its season.toml is damaged.
    """
    place = open_place(address)
    where = f"{place.address}/{SEASON_FILE}"
    try:
        table = parsed_toml(place.read(SEASON_FILE), where)
    except FileNotFoundError:
        raise DataError(
            f"{address}: is not a season. To begin one: `oarlock season init {address}`"
        ) from None
    table.check_keys(_KEYS)
    table.check_format(SEASON_FORMAT)
    setup = table.table("setup", {})
    return Season(
        place,
        table.string("name"),
        table.string("id"),
        table.string("time_zone", "UTC"),
        _retention(table.table("retention", {})),
        {("" if name == "everybody" else name): setup.string(name) for name in setup.values},
    )


def not_in_season(what: str, name: str, known: Iterable[str]) -> DataError:
    """The error for a name that a season does not have; `what` says of what."""
    return DataError(f'this season has no {what} "{name}". {did_you_mean(name, sorted(known))}')


def checked_zone(name: str, where: str) -> ZoneInfo:
    """The zone of a name.

    Raises:
        DataError: it is not known.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise DataError(
            f'{where}: "{name}" is no time zone; expected one such as Europe/Berlin or UTC'
        ) from None


def _retention(table: TomlTable) -> dict[str, int]:
    table.check_keys(("raw_months", "results_months"))
    read = partial(table.integer, default=0)
    return {key.removesuffix("_months"): read(key) for key in table.values}
