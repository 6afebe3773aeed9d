"""`erase`: removes an athlete from a season; a listing of its files and a query of its tables are the proof.

The order makes it safe against other writers: the tombstone comes first, and whoever stores something looks for a
tombstone afterwards, so one of the two removes it. An erasure that is interrupted is repeated; it goes on.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import pyarrow as pa
import pyarrow.compute as pc

from oarlock.season.arrow_table import read_table
from oarlock.season.athletes import pseudonym_hash
from oarlock.season.belongings import Belongings, belongings, folders
from oarlock.season.compact import compact, known_now, remove_unused
from oarlock.season.entry import parsed_toml
from oarlock.season.exports import remove_export
from oarlock.season.layout import ATHLETES, ERASED, LOGS, RUN_FILE, SEASON_FILE, SETUPS, TABLES
from oarlock.season.place import OWN_WORK
from oarlock.season.store import Season, not_in_season
from oarlock.season.versions import Trace, Versions, versions_of
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

_FORMAT = 1
_ROUNDS = 3
"""Removals after which what other writers still add is left to be named."""
_WORD = re.compile(rb"\w+")


@dataclass(frozen=True)
class Erasure:
    """What an erasure removed, and what it could not.

    Args:
        athlete: the pseudonym.
        is_dry_run: whether nothing was removed.
        removed: how many of what were removed, or would be.
        left: names and rows of the athlete that are still there, and what could not be looked at.
        elsewhere: copies that are out of reach, each with what to do.
        files: how many names of files were listed for the proof.
        tables: how many files of tables were queried for the proof.
    """

    athlete: str
    is_dry_run: bool
    removed: Mapping[str, int]
    left: Sequence[Trace] = ()
    elsewhere: Sequence[str] = ()
    files: int = 0
    tables: int = 0

    @property
    def is_proven(self) -> bool:
        """Whether no file name and no row of the athlete is left."""
        return not self.is_dry_run and not self.left


@dataclass
class _Work:
    """An erasure in progress."""

    season: Season
    own: Belongings
    versions: Versions
    removed: dict[str, int]
    elsewhere: list[str] = field(default_factory=list)

    @property
    def names(self) -> frozenset[str]:
        """The pseudonym and the names of the recordings."""
        return frozenset((self.own.athlete, *self.own.recordings))


def erase(season: Season, athlete: str, *, dry_run: bool = True) -> Erasure:
    """Erase an athlete, or say what would be removed.

    Args:
        season: which.
        athlete: the pseudonym.
        dry_run: remove nothing.

    Raises:
        DataError: nothing is known of this athlete, or something cannot be removed.
    """
    versions = versions_of(season.place)
    day, unfinished = _read_tombstone(season, athlete)
    began = {*unfinished, *versions.recordings_of(athlete)}
    is_known = bool(began) or season.is_erased_now(athlete) or season.athlete(athlete) is not None
    if not is_known and belongings(season, athlete).is_empty:
        raise not_in_season("athlete", athlete, season.athletes())
    if dry_run:
        return Erasure(athlete, True, _counts(belongings(season, athlete, began)))
    # Before anything is listed: what is stored later is removed by its writer, who looks for tombstones.
    _put_tombstone(season, athlete, day, sorted(began))
    found = belongings(season, athlete, began)
    work = _Work(season, found, versions, _counts(found))
    for _ in range(_ROUNDS):
        began |= set(found.recordings)
        work.own = replace(found, recordings=sorted(began))
        _put_tombstone(season, athlete, day, work.own.recordings)
        _remove(work)
        left, files, tables = _left(work)
        if not left:
            break
        found = belongings(season, athlete, began)
    if not left:
        _put_tombstone(season, athlete, day)
    _remove_versions(work)
    left += versions.left(athlete, work.own.recordings)
    return Erasure(athlete, False, work.removed, left, work.elsewhere, files, tables)


def _counts(found: Belongings) -> dict[str, int]:
    return {
        "recordings": len(found.recordings),
        "results": len(found.results),
        "rows": found.rows,
        "exports": len(found.exports),
    }


def _tombstone(season: Season, athlete: str) -> str:
    return f"{ERASED}/{pseudonym_hash(season.id, athlete)}.toml"


def _read_tombstone(season: Season, athlete: str) -> tuple[str, list[str]]:
    """The day of the first erasure, and the recordings of one that was interrupted or is not proven."""
    today, file = datetime.date.today().isoformat(), _tombstone(season, athlete)
    try:
        table = parsed_toml(season.place.read(file), file)
        listed = table.values.get("recordings", [])
        return table.string("date", today), list(map(str, listed)) if isinstance(listed, list) else []
    except (FileNotFoundError, DataError):
        return today, []


def _put_tombstone(season: Season, athlete: str, day: str, recordings: Sequence[str] = ()) -> None:
    unfinished = {"recordings": list(recordings)} if recordings else {}
    contents = toml_text({"format": _FORMAT, "date": day, **unfinished}).encode()
    season.place.write(_tombstone(season, athlete), contents)


def _remove(work: _Work) -> None:
    """Remove what is known to be the athlete's."""
    season, own = work.season, work.own
    place = season.place
    place.remove([f"{ATHLETES}/{own.athlete}.toml"])
    if own.athlete in season.setup:
        others = {name: of for name, of in season.setup.items() if name != own.athlete}
        season = work.season = replace(season, setup=others)
        place.write(SEASON_FILE, season.toml())
    for folder, record in folders(own):
        place.remove_folder(folder, record)
    # Results that were committed after they were listed.
    for recording, run in season.results():
        if recording in set(own.recordings):
            place.remove_folder(f"results/{recording}.{run}", RUN_FILE)
    for note in own.exports:
        work.elsewhere += remove_export(season, own.athlete, note)
    _clean_work(work)
    work.removed["copies in caches"] = work.removed.get("copies in caches", 0) + place.forget_copies()
    compact(season)
    remove_unused(season, 0.0)
    place.forget_copies()
    _remove_versions(work)
    _remove_setups(work)


def _clean_work(work: _Work) -> None:
    """Remove the lines of logs with a name of the athlete, and half-written folders whose texts have one."""
    place, names = work.season.place, {name.encode() for name in work.names}
    for file, _ in list(place.files(LOGS)):
        lines = place.read(file).splitlines(keepends=True)
        others = [line for line in lines if names.isdisjoint(_WORD.findall(line))]
        if len(others) < len(lines):
            place.write(file, b"".join(others))
    for folder in place.children(OWN_WORK):
        texts = [name for name, _ in place.files(f"{OWN_WORK}/{folder}") if name.endswith(".toml")]
        try:
            is_own = any(not names.isdisjoint(_WORD.findall(place.read(name))) for name in texts)
        except FileNotFoundError:
            continue  # its writer has ended
        if is_own:
            place.remove_folder(f"{OWN_WORK}/{folder}")


def _remove_versions(work: _Work) -> None:
    count = work.versions.remove(work.own.athlete, work.own.recordings)
    work.removed["object versions"] = work.removed.get("object versions", 0) + count


def _remove_setups(work: _Work) -> None:
    """Remove setups that only this athlete's runs used: their calibration is the athlete's."""
    season = work.season
    used = {*(record.setup for record in known_now(season).records), *season.setup.values()}
    only = [name for name in work.own.setups if name not in used]
    for name in only:
        season.place.remove_folder(f"{SETUPS}/{name}")
    work.removed["setups"] = work.removed.get("setups", 0) + len(only)


def _left(work: _Work) -> tuple[list[Trace], int, int]:
    """What a listing and a query of all tables find of the athlete; how many files and tables they looked at."""
    season, names = work.season, work.names
    files = [name for name, _ in season.place.files("")]
    left = [Trace(name, "its name") for name in files if not names.isdisjoint(re.findall(r"\w+", name))]
    left += [
        Trace(f"recordings/{name}", "its session") for name in belongings(season, work.own.athlete).recordings
    ]
    tables = [name for name in files if name.startswith(f"{TABLES}/") and name.endswith(".parquet")]
    for name in tables:
        try:
            rows = _rows(
                read_table(season.place.read(name), where=season.where(name), without_lists=True), names
            )
        except FileNotFoundError:
            continue  # another compaction has removed it
        except DataError as error:
            left.append(Trace(name, f"cannot be read ({error})"))
            continue
        if rows:
            left.append(Trace(name, f"{rows} rows"))
    return left, len(files), len(tables)


def _rows(table: pa.Table, names: frozenset[str]) -> int:
    """How many rows are of an athlete or one of the recordings."""
    sought = pa.array(sorted(names), pa.string())
    columns = [
        table[name].cast(pa.string()) for name in ("athlete", "recording") if name in table.column_names
    ]
    return max((pc.sum(pc.is_in(column, sought)).as_py() or 0 for column in columns), default=0)
