"""`export_athlete`: everything of an athlete as CSV and as stored, in a folder outside the season.

A note in the athlete's folder says where, so that `erase` removes the export, or names it if it is out of reach.
"""

from __future__ import annotations

import datetime
import io
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from oarlock.season.add import check_outside
from oarlock.season.athletes import check_scope
from oarlock.season.gps import CUT_FILES, GpsCut
from oarlock.season.records import athlete_folder
from oarlock.season.store import Season, not_in_season
from oarlock.season.tables import arrow_table, recording_rows, run_rows, update_tables
from oarlock.storage.arrow_csv import write_arrow_csv
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
    willing = [name for name, athlete in sorted(athletes.items()) if athlete.allows(scope)]
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
    stored = update_tables(season, athlete)
    if not stored.of:
        raise not_in_season("athlete", athlete, season.athletes())
    target = (out / athlete).resolve()
    check_outside(season, target, "choose another place")
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise DataError(f"{target}: is there already; choose another folder")
    cut = None if cut_gps_m is None else GpsCut(cut_gps_m, f"{season.id} {athlete}".encode())
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    # The note comes first: an export that is interrupted is known.
    note = {"folder": str(target), "host": socket.gethostname(), "exported": now}
    season.write(athlete, f"{_NOTES}/{secrets.token_hex(8)}.toml", toml_text(note).encode())
    top = athlete_folder(athlete)
    names = [name for name, _ in season.place.files(top) if not name.startswith(f"{top}/{_NOTES}/")]
    written: dict[str, int] = {}
    for done, name in enumerate(names, start=1):
        for file, contents in _files(season, name, name.removeprefix(f"{top}/"), cut):
            write_file(target / file, contents)
            written[file] = len(contents)
        progress(done / len(names))
    for kind, rows in (("recordings", recording_rows(stored)), ("runs", run_rows(stored))):
        contents = _csv(rows)
        write_file(target / f"csv/{kind}.csv", contents)
        written[f"csv/{kind}.csv"] = len(contents)
    about = {"format": _FORMAT, "season": season.id, "athlete": athlete, "exported": now}
    write_toml(target / EXPORT_FILE, {**about, "files": sorted(written)})
    if not season.is_here(athlete):
        _remove_files(target, [*written, EXPORT_FILE])
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
    with suppress(DataError):
        about = TomlTable.read(where / EXPORT_FILE)
        names = about.values.get("files", [])
        if (about.string("season"), about.string("athlete")) == (season.id, athlete):
            _remove_files(where, [*map(str, names if isinstance(names, list) else ()), EXPORT_FILE])
            is_left = where.exists()
            return [f"{where}: contains files that were not exported; look at them"] if is_left else []
    return [f"{where}: an export without a readable {EXPORT_FILE}; remove it by hand"]


def _files(season: Season, full: str, name: str, cut: GpsCut | None) -> Iterator[tuple[str, bytes]]:
    """A file as it is stored, and what is Parquet as CSV too."""
    with suppress(FileNotFoundError):  # gone meanwhile
        contents = season.place.read(full)
        if cut is not None and name.lower().endswith(CUT_FILES):
            contents = cut.file(contents, season.where(full))
        yield f"stored/{name}", contents
        if name.endswith(".parquet"):
            with suppress(DataError):  # damaged; it is there as stored
                yield f"csv/{name.removesuffix('.parquet')}.csv", _csv(arrow_table(contents, full))


def _csv(table: pa.Table) -> bytes:
    """As CSV, without columns of lists and maps."""
    plain = [column.name for column in table.schema if not pa.types.is_nested(column.type)]
    out = io.BytesIO()
    write_arrow_csv(table.select(plain), out)
    return out.getvalue()


def _remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove these files, and folders that are empty then."""
    for name in names:
        if folder in (folder / name).resolve().parents:
            (folder / name).unlink(missing_ok=True)
    for place in [*sorted(folder.rglob("*"), key=lambda place: -len(place.parts)), folder]:
        if place.is_dir() and not any(place.iterdir()):
            place.rmdir()
