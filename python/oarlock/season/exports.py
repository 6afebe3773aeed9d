"""`export_athlete`: everything of an athlete as CSV and as stored, in a folder outside the season.

The season keeps a note of where, so that `erase` finds the folder, or names it if it is out of reach.
"""

from __future__ import annotations

import datetime
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from oarlock.season.arrow_table import read_table, with_plain_texts
from oarlock.season.athletes import check_scope
from oarlock.season.belongings import belongings, folders
from oarlock.season.gps import CUT_FILES, GpsCut
from oarlock.season.layout import ATHLETES, EXPORTS, STROKES_FILE
from oarlock.season.schema import joined, recording_rows, run_rows, stroke_rows
from oarlock.season.store import Season, not_in_season
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text, write_toml
from oarlock.storage.write_file import write_file

EXPORT_FILE = "export.toml"
"""Written into the folder of each athlete: of whom it is, and its files."""
_FORMAT = 1


@dataclass(frozen=True)
class Exported:
    """An export of one athlete: the folder, and how many files and bytes."""

    athlete: str
    folder: str
    files: int
    bytes: int


def may_share(season: Season, scope: str) -> tuple[list[str], list[str]]:
    """Who consents to a use, and who does not, or not any more.

    Raises:
        DataError: the scope is unknown.
    """
    check_scope(scope)
    athletes, erased = season.athletes(), season.erased()
    here = [name for name in sorted(athletes) if not season.is_erased(name, erased)]
    return [name for name in here if athletes[name].allows(scope)], [
        name for name in here if not athletes[name].allows(scope)
    ]


def export_athlete(
    season: Season,
    athlete: str,
    out: Path,
    *,
    cut_gps_m: float | None = None,
    told: Callable[[float], None] = lambda share: None,
) -> Exported:
    """Write everything of an athlete into `out/PSEUDONYM`.

    Args:
        season: which.
        athlete: the pseudonym.
        out: a folder outside the season.
        cut_gps_m: remove positions that are so near to the start or the end of a track, m; None removes none.
        told: called with the share done, 0 to 1.

    Raises:
        DataError: the athlete is unknown or was erased, the folder lies in the season or is there, or positions cannot
            be cut.
    """
    if season.is_erased_now(athlete):
        raise DataError(f"{athlete} was erased from this season; there is nothing to export")
    own = belongings(season, athlete)
    if own.is_empty:
        raise not_in_season("athlete", athlete, season.athletes())
    target = _free(season, out / athlete)
    note = f"{EXPORTS}/{athlete}/{secrets.token_hex(8)}.toml"
    # The note comes first: an export that is interrupted is known.
    season.place.write(note, _note(target))
    cut = None if cut_gps_m is None else GpsCut(cut_gps_m, f"{season.id} {athlete}".encode())
    written: dict[str, int] = {}
    sources = [folder for folder, _ in folders(own)]
    for done, folder in enumerate(sources, start=1):
        for name, contents in _folder_files(season, folder, cut):
            write_file(target / name, contents)
            written[name] = len(contents)
        told(done / max(1, len(sources)))
    for name, contents in _tables(season, athlete, own.results, own.recordings):
        write_file(target / name, contents)
        written[name] = len(contents)
    about = {
        "format": _FORMAT,
        "season": season.id,
        "athlete": athlete,
        "exported": _now(),
        "files": sorted(written),
    }
    write_toml(target / EXPORT_FILE, about)
    if season.is_erased_now(athlete):
        _remove_files(target, [*written, EXPORT_FILE])
        season.place.remove([note])
        raise DataError(
            f"{athlete} was erased from this season during the export; the exported files were removed"
        )
    return Exported(athlete, str(target), len(written) + 1, sum(written.values()))


def remove_export(season: Season, athlete: str, note: str) -> list[str]:
    """Remove the export of a note, then the note.

    Returns:
        What is out of reach, with what to do.
    """
    try:
        table = TomlTable.parsed(season.place.read(note).decode(), Path(note))
        where, host = Path(table.string("folder")), table.string("host")
    except (FileNotFoundError, UnicodeDecodeError, DataError):
        season.place.remove([note])
        return [
            f"{note}: the note of an export could not be read; ask who exports, and remove the folder by hand"
        ]
    season.place.remove([note])
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


def _folder_files(season: Season, folder: str, cut: GpsCut | None) -> Iterator[tuple[str, bytes]]:
    """Files of a recording or a result as they are stored, and what is Parquet as CSV too."""
    for full, _ in season.place.files(folder):
        try:
            contents = season.place.read(full)
        except FileNotFoundError:
            continue  # gone meanwhile
        if cut is not None and full.lower().endswith(CUT_FILES):
            contents = cut.file(contents, season.where(full))
        yield f"stored/{full}", contents
        if full.endswith(".parquet"):
            try:
                table = with_plain_texts(read_table(contents, where=full, without_lists=True), full)
            except DataError:
                continue  # damaged; it is there as stored
            yield f"csv/{full.removesuffix('.parquet')}.csv", _csv(table)


def _tables(
    season: Season, athlete: str, results: Sequence[tuple[str, str]], recordings: Iterable[str]
) -> Iterator[tuple[str, bytes]]:
    entries = {entry.recording: entry for entry in season.entries(list(recordings))}
    records = list(season.run_records(list(results)))
    with suppress(FileNotFoundError):
        yield f"{athlete}.toml", season.place.read(f"{ATHLETES}/{athlete}.toml")
    yield (
        "recordings.csv",
        _csv(recording_rows(list(entries.values()), {one.recording: one for one in records})),
    )
    runs = run_rows(records)
    yield "runs.csv", _csv(runs.drop_columns(["health"]))
    strokes = []
    for one in records:
        name = f"results/{one.recording}.{one.run}/{STROKES_FILE}"
        if one.recording in entries and season.place.exists(name):
            try:
                strokes.append(
                    stroke_rows(season.place.read(name), entries[one.recording], one, season.where(name))
                )
            except DataError:
                continue  # damaged; `check` names it
    yield "strokes.csv", _csv(joined(strokes))


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


def _note(target: Path) -> bytes:
    return toml_text({"folder": str(target), "host": socket.gethostname(), "exported": _now()}).encode()


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
