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
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from oarlock.season.athletes import ATTRIBUTES, Athlete
from oarlock.season.records import STROKES_FILE, Entry, RunRecord, athlete_folder, result_folder, run_name
from oarlock.season.store import ErasedError, Season, in_threads
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

SCHEMA: Final = 3
"""Version of the columns below. Tables of another version are made anew from the results."""
_ABOUT: Final = b"season"
"""Key of the metadata: what a table was made from."""
# Names of columns that are no UTF-8 come as UnicodeDecodeError.
_UNREADABLE = (OSError, pa.ArrowException, TypeError, UnicodeDecodeError)
_STARTED = pa.timestamp("us", tz="UTC")


def _schema(texts: str, **others: pa.DataType) -> pa.Schema:
    return pa.schema([*((name, pa.string()) for name in texts.split()), *others.items()])


KEYS: Final = _schema("recording run comparable athlete boat seat rig", started=_STARTED, stroke=pa.int32())
"""First columns of `strokes`; what follows are the numbers of a stroke and their standard deviations, float32."""
RECORDINGS: Final = _schema(
    "recording athlete kind device file boat seat rig month run status fault comparable engine",
    started=_STARTED,
    duration_s=pa.float64(),
    strokes=pa.int32(),
    left_out=pa.int32(),
)
"""One row a recording, with its current run; `status` is done, failed, or waiting."""
RUNS: Final = _schema(
    "recording run engine setup comparable status fault",
    strokes=pa.int32(),
    left_out=pa.int32(),
    health=pa.map_(pa.string(), pa.float64()),
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
        return {record.recording: record for record in sorted(self.records, key=self._rank)}

    def _rank(self, record: RunRecord) -> tuple[object, ...]:
        parts = record.engine.replace("-", ".").split(".")
        version = tuple(int(part) if part.isdigit() else -1 for part in parts)
        is_own = record.run == run_name(record.engine, record.setup)  # of these rules
        return record.setup == self.setup, record.status == "done", version, is_own, record.run

    def metadata(self) -> dict[bytes, bytes]:
        """For the table."""
        entries = [{**vars(e), "start": e.start and e.start.isoformat()} for e in self.entries.values()]
        about = {"schema": SCHEMA, "setup": self.setup, "entries": entries}
        return {_ABOUT: json.dumps({**about, "records": list(map(vars, self.records))}).encode()}

    def before(self, season: Season) -> AthleteData | None:
        """What the table was made from; None if there is no table, or it is damaged or of another version."""
        moment = datetime.datetime.fromisoformat
        try:
            with open_regular(season.place.on_disk(self.file)) as file:
                about: dict[str, Any] = json.loads((parquet.read_schema(file).metadata or {})[_ABOUT])
            if about["schema"] != SCHEMA:
                return None
            entries = [Entry(**{**e, "start": e["start"] and moment(e["start"])}) for e in about["entries"]]
            records = [RunRecord(**record) for record in about["records"]]
        except (*_UNREADABLE, KeyError, ValueError):
            return None
        return AthleteData(self.athlete, about["setup"], {e.recording: e for e in entries}, records)

    def now(self, season: Season, before: AthleteData | None) -> AthleteData:
        """What is stored now; commit records are read of what is new, unfinished or failed."""
        name, old = self.athlete.pseudonym, before or self
        here, results = season.recordings_of(name), set(season.results_of(name))
        entries = {recording: old.entries[recording] for recording in here if recording in old.entries}
        for entry in season.entries(name, [recording for recording in here if recording not in entries]):
            shown = {key: text for key, text in entry.shown_session().items() if text is not None}
            entries[entry.recording] = replace(entry, session=shown, files={})
        records = {(r.recording, r.run): r for r in old.records if r.status == "done"}
        records = {pair: record for pair, record in records.items() if pair in results}
        records |= {
            (r.recording, r.run): r for r in season.run_records(name, sorted(results - records.keys()))
        }
        own = [record for _, record in sorted(records.items()) if record.recording in entries]
        return replace(self, entries=dict(sorted(entries.items())), records=own)


@dataclass(frozen=True)
class Catalogue:
    """What is stored in a season, or of one athlete."""

    of: Sequence[AthleteData]

    @property
    def entries(self) -> dict[str, Entry]:
        """All recordings by name."""
        return {name: entry for data in self.of for name, entry in data.entries.items()}

    @property
    def records(self) -> list[RunRecord]:
        """All runs."""
        return [record for data in self.of for record in data.records]

    def current(self) -> dict[str, RunRecord]:
        """The run of each recording that counts."""
        return {name: record for data in self.of for name, record in data.current().items()}


def catalogue(season: Season, athlete: str | None = None) -> Catalogue:
    """What is stored at this moment, of all athletes or of one."""
    return Catalogue(in_threads(lambda data: data.now(season, data.before(season)), _all(season, athlete)))


def update_tables(season: Season, athlete: str | None = None) -> Catalogue:
    """Bring the tables of all athletes, or of one, up to date with what is stored; writes only what changed.

    A recording whose result is damaged counts as failed.
    """
    here = _all(season, athlete)
    if athlete is None:
        season.place.forget_copies([athlete_folder(data.athlete.pseudonym) for data in here])

    def updated(data: AthleteData) -> AthleteData | None:
        before = data.before(season)
        now = data.now(season, before)
        with suppress(ErasedError):
            return now if now == before else _written(season, now, before)
        return None

    return Catalogue([data for data in in_threads(updated, here) if data is not None])


def _all(season: Season, athlete: str | None) -> list[AthleteData]:
    here = season.athletes().values() if athlete is None else [season.athlete(athlete)]
    return [AthleteData(each, each.setup or season.setup) for each in here if each is not None]


def _written(season: Season, now: AthleteData, before: AthleteData | None) -> AthleteData:
    """What is in the table that was written: former rows that are still valid, and those of new runs."""
    current = {name: run for name, run in now.current().items() if run.status == "done" and run.strokes}
    valid: list[str] = []
    tables: list[pa.Table] = []
    if before is not None:
        with suppress(DataError, OSError, KeyError):
            former = before.current()
            same = [name for name, run in current.items() if former.get(name) == run]
            table = arrow_table(season.place.read(now.file), now.file)
            tables = [table.filter(pc.is_in(table["recording"], pa.array(same, pa.string())))]
            valid = same
    new = [run for name, run in current.items() if name not in valid]
    rows = in_threads(partial(_strokes_of, season, now), new)
    if faults := {(run.recording, run.run): run for run in rows if isinstance(run, RunRecord)}:
        marked = [faults.get((record.recording, record.run), record) for record in now.records]
        return _written(season, replace(now, records=marked), before)
    contents = table_bytes(joined([*tables, *rows]), now)
    season.write(now.athlete.pseudonym, STROKES_FILE, contents)
    return now


def _strokes_of(season: Season, data: AthleteData, run: RunRecord) -> pa.Table | RunRecord:
    """Rows of a result; or, where it is damaged, the record of its failure."""
    name = f"{result_folder(data.athlete.pseudonym, run.recording, run.run)}/{STROKES_FILE}"
    try:
        contents = season.read_checked(name, run.files[STROKES_FILE])
        return stroke_rows(contents, data.entries[run.recording], run, season.where(name))
    except DataError as error:
        advice = "`oarlock season check` lists all damaged files"
        return replace(run, status="failed", fault=f"damaged: {error}; {advice}", strokes=0)


def stroke_rows(contents: bytes, entry: Entry, run: RunRecord, where: str) -> pa.Table:
    """Rows of `strokes` of one result; `joined` brings their numbers to float32."""
    table = arrow_table(contents, where)
    names = [column.name for column in table.schema if _is_number(column.type)]
    keys = {**vars(run), "athlete": entry.athlete, **entry.shown_session(), "started": entry.start}
    columns = [
        pa.repeat(pa.scalar(keys[key.name], key.type), len(table)) for key in KEYS if key.name != "stroke"
    ]
    columns.append(pa.array(range(1, len(table) + 1), pa.int32()))
    return pa.Table.from_arrays([*columns, *(table[name] for name in names)], [*KEYS.names, *names])


def joined(tables: Sequence[pa.Table]) -> pa.Table:
    """Rows of all tables, whose columns may differ, by time, recording and stroke."""
    if not tables:
        return KEYS.empty_table()
    whole = pa.concat_tables(tables, promote_options="permissive")
    for k, name in enumerate(whole.column_names):
        if name not in KEYS.names:  # NaN is missing, because DuckDB would carry it into every mean
            plain = whole.column(k).cast(pa.float32())
            number = pc.if_else(pc.is_nan(plain), pa.scalar(None, pa.float32()), plain)
            whole = whole.set_column(k, name, number)
    return whole.sort_by([(key, "ascending") for key in ("started", "recording", "stroke")])


def table_bytes(strokes: pa.Table, data: AthleteData) -> bytes:
    """The file of an athlete's strokes: float columns split by bytes, texts as indices."""
    numbers = [column.name for column in strokes.schema if pa.types.is_floating(column.type)]
    return parquet_bytes(
        strokes.replace_schema_metadata(data.metadata()),
        compression="zstd",
        use_dictionary=[column.name for column in strokes.schema if pa.types.is_string(column.type)],
        column_encoding=dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
        row_group_size=20_000,
    )


def parquet_bytes(table: pa.Table, **options: Any) -> bytes:
    """A Parquet file of a table."""
    out = io.BytesIO()
    parquet.write_table(table, out, **options)
    return out.getvalue()


def arrow_table(contents: bytes, where: str, advice: str = "") -> pa.Table:
    """The table of a Parquet file of a season; Oarlock wrote it.

    Raises:
        DataError: it is damaged; with the advice.
    """
    try:
        return parquet.read_table(pa.BufferReader(contents))
    except _UNREADABLE as error:
        raise DataError(f"{where}: cannot be read as Parquet ({error}){advice}") from error


def recording_rows(stored: Catalogue) -> pa.Table:
    """The table of recordings, by athlete and time."""
    current = stored.current()
    rows = [
        {
            **(vars(run) if (run := current.get(name)) else {"status": "waiting"}),
            **vars(entry),
            **entry.shown_session(),
            **{key: getattr(entry, key) or None for key in ("device", "file")},
            "started": entry.start,
            "month": entry.month,
        }
        for name, entry in stored.entries.items()
    ]
    order = [(key, "ascending") for key in ("athlete", "started", "recording")]
    return pa.Table.from_pylist(rows, RECORDINGS).sort_by(order)


def run_rows(stored: Catalogue) -> pa.Table:
    """The table of runs."""
    rows = [{**vars(record), "health": list(record.health.items())} for record in stored.records]
    return pa.Table.from_pylist(rows, RUNS).sort_by([("recording", "ascending"), ("run", "ascending")])


def athlete_rows(stored: Catalogue) -> pa.Table:
    """The table of athletes; those who withdrew consent to nothing."""
    athletes = sorted((data.athlete for data in stored.of), key=lambda athlete: athlete.pseudonym)
    rows = [
        {
            "athlete": athlete.pseudonym,
            **athlete.attributes,
            "consent": "" if athlete.withdrawn else ", ".join(athlete.consent),
        }
        for athlete in athletes
    ]
    return pa.Table.from_pylist(rows, _schema("athlete consent", **dict.fromkeys(ATTRIBUTES, pa.float64())))


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind))


@dataclass(frozen=True)
class SeasonSummary:
    """How much a season contains.

    Args:
        counts: numbers by what they count, in words.
        athletes: of each who was recorded: athlete, recordings, hours, strokes, first and last day, UTC.
        faults: why a recording's current run failed, by recording.
        recordings: of each, by athlete and time: athlete, started, device, file, status, strokes, left_out, recording.
    """

    name: str
    counts: Mapping[str, int]
    athletes: Sequence[Mapping[str, Any]]
    faults: Mapping[str, str]
    recordings: Sequence[Mapping[str, Any]] = ()


def season_summary(season: Season) -> SeasonSummary:
    """Count what a season contains, and list its recordings and why some failed."""
    stored = catalogue(season)
    rows = recording_rows(stored).to_pylist()
    athletes = []
    for name, group in groupby(rows, key=lambda row: row["athlete"]):
        own = list(group)
        days = [f"{row['started']:%Y-%m-%d}" for row in own if row["started"]] or [""]
        athletes.append(
            {
                "athlete": name,
                "recordings": len(own),
                "hours": sum(row["duration_s"] or 0.0 for row in own) / 3600.0,
                "strokes": sum(row["strokes"] or 0 for row in own),
                "first": min(days),
                "last": max(days),
            }
        )
    status = Counter(row["status"] for row in rows)
    counts = {
        "athletes": len(stored.of),
        "recordings": len(rows),
        "with results": status["done"],
        "failed": status["failed"],
        "waiting for `oarlock season run`": status["waiting"],
        "strokes": sum(row["strokes"] or 0 for row in rows),
        "strokes that count in no mean": sum(row["left_out"] or 0 for row in rows),
    }
    faults = {row["recording"]: row["fault"] for row in rows if row["status"] == "failed"}
    shown = ("athlete", "started", "device", "file", "status", "strokes", "left_out", "recording")
    recordings = [{key: row[key] for key in shown} for row in rows]
    return SeasonSummary(season.name, counts, athletes, dict(sorted(faults.items())), recordings)
