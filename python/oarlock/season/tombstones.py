"""Tombstones: what stays of an athlete who was erased, in the season and outside it.

A restored backup has no tombstones of later erasures. The copies outside the season, in the user's state folder and in
the files that `--tombstones` names, erase again what came back.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from oarlock.season.athletes import checked_day, pseudonym_hash
from oarlock.season.entry import parsed_toml
from oarlock.season.layout import ERASED
from oarlock.season.store import Season
from oarlock.storage.errors import DataError
from oarlock.storage.state import state_folder
from oarlock.storage.toml import TomlTable, toml_text, write_toml
from oarlock.storage.write_file import write_file

_FORMAT = 1


@dataclass(frozen=True)
class Tombstone:
    """That somebody was erased.

    Args:
        hash: of the pseudonym.
        date: day of the erasure, as ISO text.
        removed: how many of what were removed.
    """

    hash: str
    date: str
    removed: Mapping[str, int] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """Its name in the season."""
        return f"{ERASED}/{self.hash}.toml"

    def document(self) -> dict[str, object]:
        """What its file says."""
        return {"format": _FORMAT, "hash": self.hash, "date": self.date, "removed": dict(self.removed)}

    @classmethod
    def of(cls, table: TomlTable, where: str) -> Tombstone:
        """The tombstone of a table.

        Raises:
            DataError: it is damaged.
        """
        table.check_format(_FORMAT)
        name = table.string("hash")
        if len(name) != 32 or not set(name) <= set("0123456789abcdef"):
            raise DataError(f"{table.where('hash')}: is no hash of a pseudonym")
        counts = table.table("removed", {})
        date = checked_day(table.string("date"), where)
        return cls(name, date, {key: counts.integer(key, 0) for key in counts.values})


def new_tombstone(season: Season, pseudonym: str) -> Tombstone:
    """The tombstone of an athlete, of today."""
    return Tombstone(pseudonym_hash(season.id, pseudonym), datetime.date.today().isoformat())


def put_tombstone(season: Season, one: Tombstone, file: Path | None = None) -> None:
    """Write a tombstone into the season, then its copies outside.

    Args:
        season: where.
        one: the tombstone.
        file: a further file of copies; it may hold those of several seasons.

    Raises:
        DataError: one of them cannot be written.
    """
    season.place.write(one.file, toml_text(one.document()).encode())
    write_file(kept_folder(season) / f"{one.hash}.toml", toml_text(one.document()))
    if file is not None:
        others = [
            other for other in _file_tables(file) if (other["season"], other["hash"]) != (season.id, one.hash)
        ]
        mine = {"season": season.id, **one.document()}
        write_toml(file, {"format": _FORMAT, "tombstone": [*others, mine]})


def kept_folder(season: Season) -> Path:
    """The folder of the user's state that has the copies of this season's tombstones."""
    return state_folder() / "season" / season.id / ERASED


def kept(season: Season, file: Path | None = None) -> dict[str, Tombstone]:
    """Copies of tombstones outside the season, by hash.

    Raises:
        DataError: the file is damaged or not there.
    """
    copies = sorted(folder.glob("*.toml")) if (folder := kept_folder(season)).is_dir() else []
    found = [_copy(copy) for copy in copies]
    if file is not None:
        if not file.exists():
            raise DataError(f"{file}: there is no such file of tombstones")
        for values in _file_tables(file):
            if values["season"] == season.id:
                own = {key: value for key, value in values.items() if key != "season"}
                found.append(Tombstone.of(parsed_toml(toml_text(own).encode(), str(file)), str(file)))
    return {one.hash: one for one in found}


def erased_hashes(season: Season, file: Path | None = None) -> frozenset[str]:
    """Hashes of all who were erased, by the season itself or by the copies outside."""
    return season.erased() | frozenset(kept(season, file))


def restore_tombstones(season: Season, file: Path | None = None) -> list[str]:
    """Write the tombstones that a restored season lacks back into it, and those that are new here into the copies.

    Returns:
        Hashes of those that the season lacked.
    """
    outside, inside = kept(season, file), season.erased()
    lacking = sorted(set(outside) - inside)
    for name in lacking:
        season.place.write(outside[name].file, toml_text(outside[name].document()).encode())
    for name in sorted(inside - set(outside)):
        contents = season.place.read(f"{ERASED}/{name}.toml")
        write_file(kept_folder(season) / f"{name}.toml", contents)
        season.place.forget_copies()  # somebody was erased on another machine
    return lacking


def _copy(file: Path) -> Tombstone:
    """A copy; its name is enough if it is damaged."""
    try:
        return Tombstone.of(TomlTable.read(file), str(file))
    except DataError:
        return Tombstone(file.stem, datetime.date.today().isoformat())


def _file_tables(file: Path) -> list[dict[str, object]]:
    if not file.exists():
        return []
    table = TomlTable.read(file)
    table.check_format(_FORMAT)
    return [dict(one.values) for one in table.tables("tombstone")]
