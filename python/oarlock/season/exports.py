"""`export_athlete`: everything of an athlete as CSV and as stored, in a folder outside the season.

A note in the athlete's folder says where, so that `erase` finds the export, or names it if it is out of reach.
"""

from __future__ import annotations

import datetime
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from oarlock.season.arrow_table import read_table, with_plain_texts
from oarlock.season.athletes import check_scope
from oarlock.season.gps import CUT_FILES, GpsCut
from oarlock.season.records import athlete_folder
from oarlock.season.storage import OWN_WORK
from oarlock.season.store import Season, not_in_season
from oarlock.season.tables import recording_rows, run_rows, update_tables
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text, write_toml
from oarlock.storage.write_file import write_file

EXPORT_FILE = "export.toml"
"""Written into the folder of each athlete: of whom it is, and its files."""
_NOTES = "exports"
_FORMAT = 1


@dataclass(frozen=True)
class Exported:
    """An export of one athlete: the folder, and how many files and bytes."""

    athlete: str
    folder: str
    files: int
    bytes: int


def may_share(season: Season, scope: str) -> tuple[list[str], list[str]]:
    """Who consents to a use, and who does not, or not any more."""
    check_scope(scope)
    athletes = season.athletes()
    willing = [name for name, one in sorted(athletes.items()) if one.allows(scope)]
    return willing, sorted(athletes.keys() - set(willing))


def export_athlete(
    season: Season,
    athlete: str,
    out: Path,
    *,
    cut_gps_m: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Exported:
    """Write everything of an athlete into `out/PSEUDONYM`; positions so near to the ends of a track are removed, m."""
    found = update_tables(season, athlete)
    if not found.of:
        raise not_in_season("athlete", athlete, season.athletes())
    target = _free(season, out / athlete)
    # The note comes first: an export that is interrupted is known.
    note = f"{_NOTES}/{secrets.token_hex(8)}.toml"
    place = {"folder": str(target), "host": socket.gethostname(), "exported": _now()}
    written: dict[str, int] = {}
    is_here = season.write(athlete, note, toml_text(place).encode())
    cut = None if cut_gps_m is None else GpsCut(cut_gps_m, f"{season.id} {athlete}".encode())
    top = athlete_folder(athlete)
    names = [name for name, _ in season.place.files(top)]
    for done, name in enumerate(names, start=1):
        short = name.removeprefix(f"{top}/")
        if not short.startswith((f"{_NOTES}/", f"{OWN_WORK}/")):
            for file, contents in _file(season, name, short, cut):
                write_file(target / file, contents)
                written[file] = len(contents)
        progress(done / len(names))
    runs = run_rows(found).drop_columns(["health"])
    for file, table in (("csv/recordings.csv", recording_rows(found)), ("csv/runs.csv", runs)):
        write_file(target / file, contents := _csv(table))
        written[file] = len(contents)
    about = {"format": _FORMAT, "season": season.id, "athlete": athlete, "exported": _now()}
    write_toml(target / EXPORT_FILE, {**about, "files": sorted(written)})
    if not (is_here and season.is_here(athlete)):
        _remove_files(target, [*written, EXPORT_FILE])
        season.place.remove_empty(top)
        raise DataError(
            f"{athlete} was erased from this season during the export; the exported files were removed"
        )
    return Exported(athlete, str(target), len(written) + 1, sum(written.values()))


def export_notes(season: Season, athlete: str) -> list[str]:
    """Names of the notes of where exports of an athlete lie."""
    folder = f"{athlete_folder(athlete)}/{_NOTES}"
    return [f"{folder}/{name}" for name in season.place.children(folder)]


def remove_export(season: Season, athlete: str, note: str) -> list[str]:
    """Remove the export of a note; returns what is out of reach, with what to do."""
    try:
        table = TomlTable.parsed(season.place.read(note).decode(), Path(note))
        where, host = Path(table.string("folder")), table.string("host")
    except (FileNotFoundError, UnicodeDecodeError, DataError):
        return [
            f"{note}: the note of an export could not be read; ask who exports, and remove the folder by hand"
        ]
    if host != socket.gethostname():
        return [f"{where} on {host}: an export; remove it there"]
    if not where.exists():
        return [f"{where}: an export that was moved or removed; if it was moved, remove it there"]
    try:
        about = TomlTable.read(where / EXPORT_FILE)
        is_ours = (about.string("season"), about.string("athlete")) == (season.id, athlete)
        names = about.values.get("files", [])
    except DataError:
        is_ours, names = False, []
    if not is_ours:
        return [f"{where}: an export without a readable {EXPORT_FILE}; remove it by hand"]
    _remove_files(where, [*map(str, names if isinstance(names, list) else ()), EXPORT_FILE])
    return [f"{where}: contains files that were not exported; look at them"] if where.exists() else []


def _file(season: Season, full: str, name: str, cut: GpsCut | None) -> Iterator[tuple[str, bytes]]:
    """A file as it is stored, and what is Parquet as CSV too."""
    try:
        contents = season.place.read(full)
    except FileNotFoundError:
        return  # gone meanwhile
    if cut is not None and name.lower().endswith(CUT_FILES):
        contents = cut.file(contents, season.where(full))
    yield f"stored/{name}", contents
    if name.endswith(".parquet"):
        with suppress(DataError):  # damaged; it is there as stored
            table = with_plain_texts(read_table(contents, where=full, without_lists=True), full)
            yield f"csv/{name.removesuffix('.parquet')}.csv", _csv(table)


def _csv(table: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    csv.write_csv(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def _free(season: Season, target: Path) -> Path:
    whole = target.resolve()
    if "://" not in season.place.address:
        inside = Path(season.place.address).resolve()
        if inside == whole or inside in whole.parents:
            raise DataError(f"{target}: lies inside the season; choose another place")
    if whole.exists() and (not whole.is_dir() or any(whole.iterdir())):
        raise DataError(f"{target}: is there already; choose another folder")
    return whole


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def _remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove these files, and folders that are empty then."""
    for name in names:
        file = folder / name
        if folder in file.resolve().parents:
            file.unlink(missing_ok=True)
    for place in sorted((one for one in folder.rglob("*") if one.is_dir()), key=lambda one: -len(one.parts)):
        if not any(place.iterdir()):
            place.rmdir()
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
