"""Tables of a season: one file of strokes an athlete, made from the results; `catalogue` says what is stored.

`athlete=PSEUDONYM/strokes.parquet` has all strokes of the runs that count. Its metadata contain the recordings and runs
that it was made from. So a question compares two listings an athlete with it, and writes the file again where something
was added. Each file is replaced as a whole: two updates at once are both right, and the next one adds what one missed.
"""

from __future__ import annotations

import datetime
import io
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from oarlock.season.arrow_table import read_table, with_plain_texts
from oarlock.season.athletes import Athlete
from oarlock.season.records import STROKES_FILE, Entry, RunRecord, athlete_folder, result_folder
from oarlock.season.store import Season, in_threads
from oarlock.storage.errors import DataError

SCHEMA: Final = 2
"""Version of the columns below. Tables of another version are made anew from the results."""
_ABOUT: Final = b"season"
"""Key of the metadata: what a table was made from."""

KEYS: Final = pa.schema(
    [
        *(
            (name, pa.string())
            for name in ("recording", "run", "comparable", "athlete", "boat", "seat", "rig")
        ),
        ("started", pa.timestamp("us", tz="UTC")),
        ("stroke", pa.int32()),
    ]
)
"""First columns of `strokes`; what follows are the numbers of a stroke and their standard deviations, float32."""
RECORDINGS: Final = pa.schema(
    [
        *((name, pa.string()) for name in ("recording", "athlete", "kind", "boat", "seat", "rig")),
        ("started", pa.timestamp("us", tz="UTC")),
        ("month", pa.string()),
        ("duration_s", pa.float64()),
        *((name, pa.string()) for name in ("run", "status", "fault", "comparable", "engine")),
        ("strokes", pa.int32()),
    ]
)
"""One row a recording, with its current run; `status` is done, failed, or waiting."""
RUNS: Final = pa.schema(
    [
        *(
            (name, pa.string())
            for name in ("recording", "run", "engine", "setup", "comparable", "status", "fault")
        ),
        ("strokes", pa.int32()),
        ("health", pa.map_(pa.string(), pa.float64())),
    ]
)
"""One row a run of a recording, superseded ones too."""


@dataclass(frozen=True)
class AthleteData:
    """What is stored of an athlete.

    Args:
        setup: name of the setup whose runs count.
        entries: by name of the recording; without hashes.
        records: of all runs over these recordings.
    """

    athlete: Athlete
    setup: str
    entries: Mapping[str, Entry] = field(default_factory=dict)
    records: Sequence[RunRecord] = ()

    @property
    def file(self) -> str:
        """Name of the table of strokes."""
        return f"{athlete_folder(self.athlete.pseudonym)}/{STROKES_FILE}"

    def current(self) -> dict[str, RunRecord]:
        """The run of each recording that counts: of the current setup if there is one, else of the newest engine.

        A run that was done stands before one that failed.
        """
        best: dict[str, RunRecord] = {}
        for record in self.records:
            held = best.get(record.recording)
            if held is None or self._rank(record) > self._rank(held):
                best[record.recording] = record
        return best

    def _rank(self, record: RunRecord) -> tuple[object, ...]:
        parts = record.engine.replace("-", ".").split(".")
        version = tuple(int(part) if part.isdigit() else -1 for part in parts)
        return record.setup == self.setup, record.status == "done", version, record.run

    def document(self) -> bytes:
        """For the metadata of the table."""
        entries = [
            {**vars(one), "start": one.start and one.start.isoformat()} for one in self.entries.values()
        ]
        about = {"schema": SCHEMA, "setup": self.setup, "entries": entries}
        return json.dumps({**about, "records": list(map(vars, self.records))}).encode()

    def before(self, season: Season) -> AthleteData | None:
        """What the table was made from; None if there is no table, or it is damaged or of another version."""
        moment = datetime.datetime.fromisoformat
        try:
            table = read_table(season.place.on_disk(self.file), columns=[])
            about: dict[str, Any] = json.loads((table.schema.metadata or {})[_ABOUT])
            if about["schema"] != SCHEMA:
                return None
            entries = [
                Entry(**{**one, "start": None if one["start"] is None else moment(one["start"])})
                for one in about["entries"]
            ]
            records = [RunRecord(**one) for one in about["records"]]
            return AthleteData(self.athlete, about["setup"], {one.recording: one for one in entries}, records)
        except (OSError, DataError, KeyError, ValueError, TypeError):
            return None

    def now(self, season: Season, before: AthleteData | None) -> AthleteData:
        """What is stored now; commit records are read of what is new, unfinished or failed."""
        name, old = self.athlete.pseudonym, before or self
        here, results = season.recordings_of(name), set(season.results_of(name))
        entries = {one: old.entries[one] for one in here if one in old.entries}
        for entry in season.entries(name, [one for one in here if one not in entries]):
            shown = {key: text for key, text in entry.shown_session().items() if text is not None}
            entries[entry.recording] = replace(entry, session=shown, files={})
        records = [one for one in old.records if one.status == "done" and (one.recording, one.run) in results]
        known = {(one.recording, one.run) for one in records}
        records += [replace(one, files={}) for one in season.run_records(name, sorted(results - known))]
        records = [one for one in records if one.recording in entries]
        return replace(
            self,
            entries=dict(sorted(entries.items())),
            records=sorted(records, key=lambda one: (one.recording, one.run)),
        )


@dataclass(frozen=True)
class Catalogue:
    """What is stored in a season, or of one athlete."""

    of: Sequence[AthleteData]

    @property
    def athletes(self) -> dict[str, Athlete]:
        """All athletes by pseudonym."""
        return {one.athlete.pseudonym: one.athlete for one in self.of}

    @property
    def entries(self) -> dict[str, Entry]:
        """All recordings by name."""
        return {name: entry for one in self.of for name, entry in one.entries.items()}

    @property
    def records(self) -> list[RunRecord]:
        """All runs."""
        return [record for one in self.of for record in one.records]

    def current(self) -> dict[str, RunRecord]:
        """The run of each recording that counts."""
        return {name: record for one in self.of for name, record in one.current().items()}


def catalogue(season: Season, athlete: str | None = None) -> Catalogue:
    """What is stored at this moment, of all athletes or of one."""
    return Catalogue(in_threads(lambda one: one.now(season, one.before(season)), _all(season, athlete)))


def update_tables(season: Season, athlete: str | None = None) -> Catalogue:
    """Bring the tables of all athletes, or of one, up to date with what is stored; writes only what changed.

    A recording whose result is damaged counts as failed.
    """
    here = _all(season, athlete)
    if athlete is None:
        season.place.forget_copies([athlete_folder(one.athlete.pseudonym) for one in here])

    def updated(one: AthleteData) -> AthleteData | None:
        before = one.before(season)
        now = one.now(season, before)
        return now if now == before else _written(season, now, before)

    found = in_threads(updated, here)
    return Catalogue([one for one in found if one is not None])


def _all(season: Season, athlete: str | None) -> list[AthleteData]:
    if athlete is None:
        here = list(season.athletes().values())
    else:
        here = [one for one in (season.athlete(athlete),) if one is not None]
    return [AthleteData(one, one.setup or season.setup) for one in here]


def _written(season: Season, now: AthleteData, before: AthleteData | None) -> AthleteData | None:
    """What is in the table that was written; None if the athlete was erased meanwhile."""
    current = [one for one in now.current().values() if one.status == "done" and one.strokes]
    kept = None if before is None else _kept(season, now, current)
    have = set() if kept is None else _pairs(kept)
    new = [one for one in current if (one.recording, one.run) not in have]
    tables = in_threads(partial(_strokes_of, season, now), new)
    faults = {(one.recording, one.run): one for one in tables if isinstance(one, RunRecord)}
    if faults:
        marked = [faults.get((one.recording, one.run), one) for one in now.records]
        return _written(season, replace(now, records=marked), before)
    whole = joined([one for one in (kept, *tables) if isinstance(one, pa.Table)])
    name = now.athlete.pseudonym
    return now if season.write(name, STROKES_FILE, table_bytes(whole, now)) else None


def _kept(season: Season, now: AthleteData, current: Iterable[RunRecord]) -> pa.Table | None:
    """The rows of the former table that are still valid."""
    try:
        table = with_plain_texts(read_table(season.place.on_disk(now.file)), now.file)
        text = pc.binary_join_element_wise(table["recording"], table["run"], ".")
    except (DataError, OSError, KeyError):
        return None
    return table.filter(
        pc.is_in(text, pa.array([f"{one.recording}.{one.run}" for one in current], pa.string()))
    )


def _pairs(table: pa.Table) -> set[tuple[str, str]]:
    found = table.group_by(["recording", "run"]).aggregate([])
    return set(zip(found["recording"].to_pylist(), found["run"].to_pylist(), strict=True))


def _strokes_of(season: Season, data: AthleteData, record: RunRecord) -> pa.Table | RunRecord:
    """Rows of a result; or, where it is damaged, the record of its failure."""
    name = f"{result_folder(data.athlete.pseudonym, record.recording, record.run)}/{STROKES_FILE}"
    try:
        return stroke_rows(
            season.place.read(name), data.entries[record.recording], record, season.where(name)
        )
    except FileNotFoundError:
        fault = f"{season.where(name)}: is missing"
    except DataError as error:
        fault = str(error)
    return replace(record, status="failed", fault=f"damaged: {fault}", strokes=0)


def stroke_rows(contents: bytes, entry: Entry, run: RunRecord, where: str) -> pa.Table:
    """Rows of `strokes` of one result; `joined` brings their numbers to float32."""
    advice = "; `oarlock season check` lists all damaged files"
    found = read_table(contents, advice, where, without_lists=True)
    names = [one.name for one in found.schema if _is_number(one.type)]
    keys = {key: getattr(run, key) for key in ("recording", "run", "comparable")}
    keys |= {"athlete": entry.athlete, **entry.shown_session(), "started": entry.start}
    count = found.num_rows
    columns = [pa.repeat(pa.scalar(keys[one.name], one.type), count) for one in KEYS if one.name != "stroke"]
    columns.append(pa.array(range(1, count + 1), pa.int32()))
    return pa.Table.from_arrays([*columns, *(found[name] for name in names)], [*KEYS.names, *names])


def joined(tables: Sequence[pa.Table]) -> pa.Table:
    """Rows of all tables, whose columns may differ, by time, recording and stroke."""
    if not tables:
        return KEYS.empty_table()
    whole = pa.concat_tables(tables, promote_options="permissive")
    columns = [
        column if name in KEYS.names else _without_nan(column)
        for name, column in zip(whole.column_names, whole.columns, strict=True)
    ]
    order = [(key, "ascending") for key in ("started", "recording", "stroke")]
    return pa.table(columns, whole.column_names).sort_by(order)


def table_bytes(strokes: pa.Table, data: AthleteData) -> bytes:
    """The file of an athlete's strokes: float columns split by bytes, texts as indices."""
    numbers = [one.name for one in strokes.schema if pa.types.is_floating(one.type)]
    texts = [one.name for one in strokes.schema if pa.types.is_string(one.type)]
    out = io.BytesIO()
    parquet.write_table(
        strokes.replace_schema_metadata({_ABOUT: data.document()}),
        out,
        compression="zstd",
        use_dictionary=texts,
        column_encoding=dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
        row_group_size=20_000,
    )
    return out.getvalue()


def recording_rows(found: Catalogue) -> pa.Table:
    """The table of recordings, by athlete and time."""
    rows, current = [], found.current()
    for entry in found.entries.values():
        run = current.get(entry.recording)
        keys = ("run", "status", "fault", "comparable", "engine", "strokes")
        known = {key: getattr(run, key) for key in keys} if run else {"status": "waiting"}
        plain = {key: getattr(entry, key) for key in ("recording", "athlete", "kind", "month", "duration_s")}
        rows.append({**plain, **entry.shown_session(), "started": entry.start, **known})
    order = [(key, "ascending") for key in ("athlete", "started", "recording")]
    return pa.Table.from_pylist(rows, RECORDINGS).sort_by(order)


def run_rows(found: Catalogue) -> pa.Table:
    """The table of runs."""
    rows = [{**vars(one), "health": list(one.health.items())} for one in found.records]
    return pa.Table.from_pylist(rows, RUNS).sort_by([("recording", "ascending"), ("run", "ascending")])


def athlete_rows(found: Catalogue) -> pa.Table:
    """The table of athletes; those who withdrew consent to nothing."""
    rows = [
        {
            "athlete": name,
            **{key: one.attributes.get(key) for key in ("stature_m", "mass_kg")},
            "consent": "" if one.withdrawn else ", ".join(one.consent),
        }
        for name, one in sorted(found.athletes.items())
    ]
    kinds = {
        "athlete": pa.string(),
        "stature_m": pa.float64(),
        "mass_kg": pa.float64(),
        "consent": pa.string(),
    }
    return pa.Table.from_pylist(rows, pa.schema(list(kinds.items())))


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind))


def _without_nan(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """The numbers as float32; NaN is missing, because DuckDB would carry it into every mean."""
    plain = column.cast(pa.float32())
    return pc.if_else(pc.is_nan(plain), pa.scalar(None, pa.float32()), plain)


@dataclass(frozen=True)
class SeasonSummary:
    """How much a season contains.

    Args:
        counts: numbers by what they count, in words.
        athletes: of each who was recorded: athlete, recordings, hours, strokes, first and last day, UTC.
        faults: why a recording's current run failed, by recording.
    """

    name: str
    counts: Mapping[str, int]
    athletes: Sequence[Mapping[str, Any]]
    faults: Mapping[str, str]


def season_summary(season: Season) -> SeasonSummary:
    """Count what a season contains, and list why recordings failed."""
    known = catalogue(season)
    current = known.current()
    status = Counter(current[name].status if name in current else "waiting" for name in known.entries)
    athletes = []
    for one in known.of:
        entries = one.entries.values()
        days = sorted(f"{entry.start:%Y-%m-%d}" for entry in entries if entry.start is not None) or [""]
        row = {
            "athlete": one.athlete.pseudonym,
            "recordings": len(entries),
            "hours": sum(entry.duration_s or 0.0 for entry in entries) / 3600.0,
            "strokes": sum(record.strokes for record in one.current().values()),
            "first": days[0],
            "last": days[-1],
        }
        athletes += [row] if entries else []
    counts = {
        "athletes": len(known.of),
        "recordings": len(known.entries),
        "with results": status["done"],
        "failed": status["failed"],
        "waiting for `oarlock season run`": status["waiting"],
        "strokes": sum(record.strokes for record in current.values()),
    }
    faults = {name: record.fault for name, record in sorted(current.items()) if record.status == "failed"}
    return SeasonSummary(season.name, counts, athletes, faults)
