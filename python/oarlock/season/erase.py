"""`erase`: removes everything of an athlete from a season, and proves by a search that nothing is left.

The order makes it safe against other writers: the tombstone comes first, and whoever stores something looks for a
tombstone afterwards, so one of the two removes it. An erasure that is interrupted is repeated; it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from oarlock.season.belongings import Belongings, belongings, folders
from oarlock.season.compact import compact, known_now, remove_unused
from oarlock.season.exports import remove_export
from oarlock.season.layout import ATHLETES, RUN_FILE, SEASON_FILE, SETUPS
from oarlock.season.remains import remove_remains
from oarlock.season.search import search
from oarlock.season.store import Season, not_in_season
from oarlock.season.tombstones import Tombstone, kept_folder, new_tombstone, put_tombstone
from oarlock.season.traces import Sought, Trace
from oarlock.season.versions import Versions, versions_of
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, write_toml

Told = Callable[[float], None]
_ROUNDS = 3
"""Searches after which what other writers still add is left to be named."""


@dataclass(frozen=True)
class Erasure:
    """What an erasure removed, and what it could not.

    Args:
        athlete: the pseudonym.
        is_dry_run: whether nothing was removed.
        removed: how many of what were removed, or would be.
        cleared: traces that the search found, such as notes of others, and that were removed then.
        left: traces that are still there, and files that could not be searched.
        elsewhere: copies that are out of reach, each with what to do.
        files: how many files were searched.
    """

    athlete: str
    is_dry_run: bool
    removed: Mapping[str, int]
    cleared: Sequence[Trace] = ()
    left: Sequence[Trace] = ()
    elsewhere: Sequence[str] = ()
    files: int = 0

    @property
    def is_proven(self) -> bool:
        """Whether every file was searched and nothing was found."""
        return not self.is_dry_run and not self.left


@dataclass
class _Work:
    """An erasure in progress."""

    season: Season
    own: Belongings
    sought: Sought
    versions: Versions
    removed: dict[str, int] = field(default_factory=dict)
    cleared: list[Trace] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)


def erase(
    season: Season,
    athlete: str,
    *,
    names: Sequence[str] = (),
    tombstones: Path | None = None,
    dry_run: bool = True,
    told: Told = lambda share: None,
) -> Erasure:
    """Erase an athlete, or say what would be removed.

    Args:
        season: which.
        athlete: the pseudonym.
        names: of the person, which are searched too.
        tombstones: a further file that keeps copies of tombstones, for restored backups.
        dry_run: remove nothing.
        told: called with the share of files searched, 0 to 1.

    Raises:
        DataError: nothing is known of this athlete, or something cannot be removed.
    """
    pending = kept_folder(season).parent / "pending" / f"{new_tombstone(season, athlete).hash}.toml"
    versions = versions_of(season.place)
    began = {*_read_pending(pending), *versions.recordings_of(athlete)}
    is_known = bool(began) or season.is_erased_now(athlete) or season.athlete(athlete) is not None
    if not is_known and belongings(season, athlete).is_empty:
        raise not_in_season("athlete", athlete, season.athletes())
    if not dry_run:
        # Before anything is listed: what is stored later is removed by its writer, who looks for tombstones.
        put_tombstone(season, _with_former(season, new_tombstone(season, athlete)), tombstones)
    found = belongings(season, athlete, began)
    known = sorted(began.union(found.recordings))
    own = replace(found, recordings=known)
    work = _Work(season, own, Sought.of(athlete, known, names), versions, _counts(found))
    if dry_run:
        files = _files(season)
        mine = tuple(f"{folder}/" for folder, _ in folders(own))
        aside = (*mine, *found.exports, "tables/", f"{ATHLETES}/{athlete}.")
        others = [name for name in files if not name.startswith(aside)]
        traces = search(season.place, work.sought, others, told)
        return Erasure(athlete, True, work.removed, left=traces, files=len(files))
    write_toml(pending, {"recordings": known})
    tombstone = replace(new_tombstone(season, athlete), removed=work.removed)
    put_tombstone(season, _with_former(season, tombstone), tombstones)
    _remove(work)
    left, files_searched = _proof(work, told)
    if not left:
        pending.unlink(missing_ok=True)
    return Erasure(athlete, False, work.removed, work.cleared, left, work.elsewhere, files_searched)


def _counts(found: Belongings) -> dict[str, int]:
    return {
        "recordings": len(found.recordings),
        "results": len(found.results),
        "rows": found.rows,
        "exports": len(found.exports),
    }


def _with_former(season: Season, one: Tombstone) -> Tombstone:
    """The tombstone with the date and the counts of the first erasure, if this one is repeated."""
    try:
        former = Tombstone.of(
            TomlTable.parsed(season.place.read(one.file).decode(), Path(one.file)), one.file
        )
    except (FileNotFoundError, UnicodeDecodeError, DataError):
        return one
    keys = {*former.removed, *one.removed}
    return replace(
        former, removed={key: max(former.removed.get(key, 0), one.removed.get(key, 0)) for key in keys}
    )


def _read_pending(file: Path) -> list[str]:
    """Recordings of an erasure that was interrupted, or is not proven yet."""
    if not file.exists():
        return []
    listed = TomlTable.read(file).values.get("recordings", [])
    return [str(name) for name in listed] if isinstance(listed, list) else []


def _remove(work: _Work) -> None:
    """Remove what is known to be the athlete's."""
    season, own = work.season, work.own
    place = season.place
    place.remove([f"{ATHLETES}/{own.athlete}.toml"])
    if own.athlete in season.setup:
        others = {name: of for name, of in season.setup.items() if name != own.athlete}
        work.season = replace(season, setup=others)
        place.write(SEASON_FILE, work.season.toml())
    for folder, record in folders(own):
        place.remove_folder(folder, record)
    # Results that were committed after they were listed.
    for recording, run in season.results():
        if recording in set(own.recordings):
            place.remove_folder(f"results/{recording}.{run}", RUN_FILE)
    for note in own.exports:
        work.elsewhere += remove_export(season, own.athlete, note)
    work.removed["copies in caches"] = place.forget_copies()
    _compact(work)
    _remove_setups(work)


def _compact(work: _Work) -> None:
    compact(work.season)
    remove_unused(work.season, 0.0)
    work.season.place.forget_copies()
    work.removed["object versions"] = work.removed.get("object versions", 0) + work.versions.remove(
        work.own.athlete, work.own.recordings
    )


def _remove_setups(work: _Work) -> None:
    """Remove setups that only this athlete's runs used: their calibration is the athlete's."""
    season = work.season
    used = {*(record.setup for record in known_now(season).records), *season.setup.values()}
    only = [name for name in work.own.setups if name not in used]
    for name in only:
        season.place.remove_folder(f"{SETUPS}/{name}")
    work.removed["setups"] = len(only)


def _proof(work: _Work, told: Told) -> tuple[list[Trace], int]:
    """What is left after a search of every file, and how many files were searched.

    Traces that can be removed are, such as notes of others; then these files and those that are new are searched again.
    """
    season = work.season
    seen: set[str] = set()
    left: list[Trace] = []
    for round_ in range(_ROUNDS):
        files = _files(season)
        again = {one.file for one in left}
        left = search(
            season.place, work.sought, [name for name in files if name not in seen or name in again], told
        )
        seen |= set(files)
        found = [one for one in left if not one.is_unsearched]
        if not found or round_ == _ROUNDS - 1:
            break
        cleared, needs_tables = remove_remains(season, work.sought, work.own, found)
        if not cleared:
            break
        work.cleared += cleared
        if needs_tables:
            season.place.remove(["tables/current.toml"])
        _compact(work)
    left = [one for one in left if one.is_unsearched or season.place.exists(one.file)]
    left += work.versions.search(work.sought)
    return left, len(seen)


def _files(season: Season) -> list[str]:
    return [name for name, _ in season.place.files("")]
