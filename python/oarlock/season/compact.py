"""Compaction: collects all recordings, runs and strokes in tables by month; writes only months that changed.

`tables/current.toml` names the valid files and is replaced last, so a reader finds either the old or the new tables.
File names are hashes of the contents. Two compactions at once are both right; if one misses a new result, the next adds
it, because tables are compared with what is stored before they are used.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import pyarrow as pa
import pyarrow.compute as pc

from oarlock.season.arrow_table import read_table, with_plain_texts
from oarlock.season.athletes import Athlete
from oarlock.season.entry import Entry, parsed_toml, texts
from oarlock.season.layout import (
    CURRENT_FILE,
    STROKES_FILE,
    TABLES,
    named_by,
    named_by_document,
    result_folder,
)
from oarlock.season.run_record import RunRecord
from oarlock.season.schema import (
    RECORDINGS,
    RUNS,
    SCHEMA,
    joined,
    parquet_bytes,
    recording_rows,
    run_rows,
    stroke_rows,
)
from oarlock.season.store import Season
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

_READERS = 8
_ATTEMPTS = 20
_UNUSED_S = 600.0
"""Files of tables that do not count are removed when they are older: another compaction may be about to name them."""


@dataclass(frozen=True)
class Current:
    """Which table files are valid.

    Args:
        schema: version of their columns.
        files: by table: `recordings`, `runs`, `athletes`, and `strokes/month=2026-03` for each month.
        erased: stands for the tombstones of which nothing is in these files.
        setup: stands for the current setups by which runs were chosen.
    """

    schema: int = SCHEMA
    files: Mapping[str, str] = field(default_factory=dict)
    erased: str = ""
    setup: str = ""

    @classmethod
    def read(cls, season: Season) -> Current:
        """The tables that count now; none if nothing was compacted, or by another version."""
        try:
            table = parsed_toml(season.place.read(CURRENT_FILE), season.where(CURRENT_FILE))
        except FileNotFoundError:
            return cls()
        if table.integer("schema", 0) != SCHEMA:
            return cls()
        return cls(SCHEMA, texts(table.table("files")), table.string("erased", ""), table.string("setup", ""))

    def toml(self) -> bytes:
        """The contents of `tables/current.toml`."""
        head = {"schema": self.schema, "erased": self.erased, "setup": self.setup}
        return toml_text({**head, "files": dict(sorted(self.files.items()))}).encode()


@dataclass(frozen=True)
class Known:
    """What is stored, as read from the commit records."""

    entries: Mapping[str, Entry]
    records: Sequence[RunRecord]

    def current(self, season: Season) -> dict[str, RunRecord]:
        """The run of each recording that counts: of the season's setup if there is one, else of the newest engine.

        A run that was done stands before one that failed.
        """
        best: dict[str, RunRecord] = {}
        for record in self.records:
            entry = self.entries.get(record.recording)
            if entry is None:
                continue
            wanted = season.setup.get(entry.athlete, season.setup.get("", ""))
            held = best.get(record.recording)
            if held is None or _rank(record, wanted) > _rank(held, wanted):
                best[record.recording] = record
        return best


def compact(season: Season) -> Current:
    """Bring the tables up to date with what is stored; nothing is written if they are.

    A recording whose result is damaged counts as failed.
    """
    disturbed = 0
    while True:
        erased = season.erased()
        try:
            after = _compacted(season, erased)
        except DataError as error:
            # An erasure removes files of tables that do not count, also one that is being written.
            disturbed += 1
            if not isinstance(error.__cause__, FileNotFoundError) or disturbed == _ATTEMPTS:
                raise
            continue
        if season.erased() == erased and all(map(season.place.exists, after.files.values())):
            if erased:  # perhaps from another machine: copies of former tables have the athlete
                season.place.forget_copies(after.files.values())
            return after
        # Somebody was erased meanwhile: what was just written may contain rows of this athlete.
        for name in after.files.values():
            season.place.remove([name])


def _compacted(season: Season, erased: frozenset[str]) -> Current:
    before = Current.read(season)
    mark = named_by_document(sorted(erased)) if erased else ""
    if _are_up_to_date(season, before, erased, mark):
        return before
    old = _old(season, before)
    tabled = {entry.athlete for entry in old.entries.values()}
    clean = tabled if before.erased == mark else set()
    gone = _gone(season, tabled - clean, erased)
    known = _known(season, old, erased, clean)
    athletes = season.athletes()
    for one in _gone(season, set(athletes) - clean, erased):
        del athletes[one]
    strokes, known = _stroke_files(season, before, known)
    current = known.current(season)
    files = {
        **strokes,
        "recordings": _put(season, "recordings", recording_rows(list(known.entries.values()), current)),
        "runs": _put(season, "runs", run_rows(known.records)),
        "athletes": _put(season, "athletes", athlete_rows(athletes)),
    }
    after = Current(SCHEMA, files, mark, _setup_mark(season))
    if after != before:
        season.place.write(CURRENT_FILE, after.toml())
    # Former tables have rows of those who were erased since.
    remove_unused(season, 0.0 if gone else _UNUSED_S)
    return after


def _gone(season: Season, asked: Iterable[str], erased: frozenset[str]) -> set[str]:
    """The erased among these athletes; each hash takes 20 ms."""
    return {one for one in set(asked) if season.is_erased(one, erased)} if erased else set()


def known_now(season: Season) -> Known:
    """What is stored at this moment."""
    return _known(season, _old(season, Current.read(season)), season.erased())


def _are_up_to_date(season: Season, current: Current, erased: frozenset[str], mark: str) -> bool:
    """Whether the tables hold all that is stored; compares listings and reads nothing that is in them already."""
    place, files = season.place, current.files
    if (current.erased, current.setup) != (mark, _setup_mark(season)):
        return False
    if not {"recordings", "runs", "athletes"} <= set(files) or not all(map(place.exists, files.values())):
        return False
    try:
        recordings, runs, people = (
            place.on_disk([files[name]])[0] for name in ("recordings", "runs", "athletes")
        )
        held = set(read_table(recordings, columns=["recording"])["recording"].to_pylist())
        made = _pairs(read_table(runs, columns=["recording", "run"]))
        tabled = set(read_table(people, columns=["athlete"])["athlete"].to_pylist())
    except (DataError, OSError, KeyError):
        return False
    here, results = set(season.recordings()), set(season.results())
    if not (held <= here and made <= results):
        return False
    # What is stored and in no table is unfinished, damaged or nobody's, or else it is new.
    others = sorted(one for one in results - made if one[0] in held)
    if any(True for _ in season.entries(sorted(here - held))) or any(
        True for _ in season.run_records(others)
    ):
        return False
    athletes = season.athletes()
    for one in _gone(season, set(athletes) - tabled, erased):
        del athletes[one]
    return _file_of(season, "athletes", athlete_rows(athletes))[0] == files["athletes"]


def _setup_mark(season: Season) -> str:
    return named_by_document(dict(season.setup))


def remove_unused(season: Season, older_s: float) -> None:
    """Remove files of tables that no longer count and are older than this, s."""
    place, used = season.place, {*Current.read(season).files.values(), CURRENT_FILE}
    others = [name for name, _ in place.files(TABLES) if name not in used]
    place.remove([name for name in others if older_s <= 0.0 or place.age_s(name) > older_s])


def athlete_rows(athletes: Mapping[str, Athlete]) -> pa.Table:
    """The table of athletes."""
    scopes = ", ".join
    rows = [
        {
            "athlete": one.pseudonym,
            "stature_m": one.attributes.get("stature_m"),
            "mass_kg": one.attributes.get("mass_kg"),
            "consent": "" if one.withdrawn else scopes(one.consent),
        }
        for one in athletes.values()
    ]
    kinds = [
        ("athlete", pa.string()),
        ("stature_m", pa.float64()),
        ("mass_kg", pa.float64()),
        ("consent", pa.string()),
    ]
    return pa.Table.from_pylist(rows, pa.schema(kinds)).sort_by("athlete")


def _rank(record: RunRecord, wanted: str) -> tuple[object, ...]:
    version = tuple(
        int(part) if part.isdigit() else -1 for part in record.engine.replace("-", ".").split(".")
    )
    return record.setup == wanted, record.status == "done", version, record.run


def _old(season: Season, current: Current) -> Known:
    """What the present tables were made from, without reading every commit record again."""
    if not {"recordings", "runs"} <= set(current.files):
        return Known({}, ())
    try:
        files = season.place.on_disk([current.files["recordings"], current.files["runs"]])
        recordings = read_table(files[0], columns=RECORDINGS.names).to_pylist()
        runs = read_table(files[1], columns=RUNS.names).to_pylist()
    except (DataError, OSError):
        return Known({}, ())  # damaged or gone: all is read anew
    entries = {
        row["recording"]: Entry(
            row["recording"],
            row["athlete"],
            row["kind"],
            row["started"],
            row["duration_s"],
            {key: row[key] for key in ("boat", "seat", "rig") if row[key] is not None},
        )
        for row in recordings
    }
    return Known(entries, [RunRecord(**{**row, "health": dict(row["health"] or ())}) for row in runs])


def _known(season: Season, old: Known, erased: frozenset[str], clean: Iterable[str] = ()) -> Known:
    """What is stored, without erased athletes; those in `clean` are known not to be erased."""
    here = season.recordings()
    entries = {name: old.entries[name] for name in here if name in old.entries}
    new = season.entries([name for name in here if name not in entries])
    entries |= {entry.recording: entry for entry in new}
    gone = _gone(season, {entry.athlete for entry in entries.values()}.difference(clean), erased)
    entries = {name: entry for name, entry in entries.items() if entry.athlete not in gone}
    results = set(season.results())
    kept = [record for record in old.records if (record.recording, record.run) in results]
    have = {(record.recording, record.run) for record in kept}
    fresh = season.run_records(sorted(results - have))
    records = [record for record in (*kept, *fresh) if record.recording in entries]
    return Known(dict(sorted(entries.items())), sorted(records, key=lambda one: (one.recording, one.run)))


def _stroke_files(season: Season, before: Current, known: Known) -> tuple[dict[str, str], Known]:
    """The file of each month; and `known`, in which runs with a damaged result have failed."""
    months: dict[str, list[RunRecord]] = {}
    for name, record in sorted(known.current(season).items()):
        if record.status == "done" and record.strokes:
            months.setdefault(known.entries[name].month, []).append(record)
    files: dict[str, str] = {}
    faults: dict[tuple[str, str], RunRecord] = {}
    for month, records in sorted(months.items()):
        table = f"strokes/month={month}"
        files[table] = _month(season, table, before.files.get(table), (records, known.entries), faults)
    if not faults:
        return files, known
    marked = [faults.get((record.recording, record.run), record) for record in known.records]
    return _stroke_files(season, before, Known(known.entries, marked))


def _month(
    season: Season,
    table: str,
    before: str | None,
    of: tuple[Sequence[RunRecord], Mapping[str, Entry]],
    faults: dict[tuple[str, str], RunRecord],
) -> str:
    """The file of a month's strokes; the one from before if it has the same runs."""
    records, entries = of
    about = [(record.recording, record.run) for record in records]
    name = f"{TABLES}/{table}/{named_by_document([SCHEMA, about])}.parquet"
    if name == before and season.place.exists(name):
        return name
    kept = _kept(season, before, set(about))
    have = _pairs(kept)
    new = [record for record in records if (record.recording, record.run) not in have]
    with ThreadPoolExecutor(_READERS) as pool:
        tables = list(pool.map(partial(_strokes_of, season, entries, faults), new))
    if any((record.recording, record.run) in faults for record in new):
        return ""  # all is done again without them
    whole = joined([table for table in (kept, *tables) if table is not None])
    season.place.write(name, parquet_bytes(whole, {"schema": str(SCHEMA), "season": season.id}))
    return name


def _kept(season: Season, before: str | None, wanted: set[tuple[str, str]]) -> pa.Table | None:
    """The rows of the month's previous file that are still valid."""
    if before is None:
        return None
    try:
        table = with_plain_texts(read_table(season.place.on_disk([before])[0]), before)
    except (DataError, OSError):
        return None
    text = pc.binary_join_element_wise(table["recording"], table["run"], ".")
    return table.filter(pc.is_in(text, pa.array([f"{recording}.{run}" for recording, run in wanted])))


def _pairs(table: pa.Table | None) -> set[tuple[str, str]]:
    """Recording and run of each row."""
    if table is None:
        return set()
    found = table.group_by(["recording", "run"]).aggregate([])
    return set(zip(found["recording"].to_pylist(), found["run"].to_pylist(), strict=True))


def _strokes_of(
    season: Season, entries: Mapping[str, Entry], faults: dict[tuple[str, str], RunRecord], record: RunRecord
) -> pa.Table | None:
    name = f"{result_folder(record.recording, record.run)}/{STROKES_FILE}"
    try:
        return stroke_rows(season.place.read(name), entries[record.recording], record, season.where(name))
    except FileNotFoundError:
        fault = f"{season.where(name)}: is missing"
    except DataError as error:
        fault = str(error)
    faults[record.recording, record.run] = replace(
        record, status="failed", fault=f"damaged: {fault}", strokes=0
    )
    return None


def _file_of(season: Season, name: str, table: pa.Table) -> tuple[str, bytes]:
    """Name and contents of a table's file."""
    contents = parquet_bytes(table, {"schema": str(SCHEMA), "season": season.id})
    return f"{TABLES}/{name}-{named_by(contents)}.parquet", contents


def _put(season: Season, name: str, table: pa.Table) -> str:
    file, contents = _file_of(season, name, table)
    if not season.place.exists(file):
        season.place.write(file, contents)
    return file
