"""Columns of the compacted tables, and how a result's strokes become rows of them."""

from __future__ import annotations

import datetime
import io
from collections.abc import Mapping, Sequence
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from oarlock.season.arrow_table import read_table
from oarlock.season.entry import Entry
from oarlock.season.run_record import RunRecord

SCHEMA: Final = 1
"""Version of the columns below. Tables of another version are made anew from the results at the next compaction."""

KEYS: Final = pa.schema(
    [
        ("recording", pa.string()),
        ("run", pa.string()),
        ("comparable", pa.string()),
        ("athlete", pa.string()),
        ("boat", pa.string()),
        ("seat", pa.string()),
        ("rig", pa.string()),
        ("started", pa.timestamp("us", tz="UTC")),
        ("stroke", pa.int32()),
    ]
)
"""First columns of `strokes`; what follows are the numbers of a stroke and their standard deviations, float32."""
RECORDINGS: Final = pa.schema(
    [
        ("recording", pa.string()),
        ("athlete", pa.string()),
        ("kind", pa.string()),
        ("boat", pa.string()),
        ("seat", pa.string()),
        ("rig", pa.string()),
        ("started", pa.timestamp("us", tz="UTC")),
        ("month", pa.string()),
        ("duration_s", pa.float64()),
        ("run", pa.string()),
        ("status", pa.string()),
        ("fault", pa.string()),
        ("strokes", pa.int32()),
    ]
)
"""One row a recording, with its current run; `status` is done, failed, or waiting."""
RUNS: Final = pa.schema(
    [
        ("recording", pa.string()),
        ("run", pa.string()),
        ("engine", pa.string()),
        ("setup", pa.string()),
        ("comparable", pa.string()),
        ("status", pa.string()),
        ("fault", pa.string()),
        ("strokes", pa.int32()),
        ("health", pa.map_(pa.string(), pa.float64())),
    ]
)
"""One row a run of a recording, superseded ones too."""


def recording_rows(entries: Sequence[Entry], current: Mapping[str, RunRecord]) -> pa.Table:
    """The table of recordings, by athlete and time."""
    rows = []
    for entry in entries:
        run = current.get(entry.recording)
        known = (
            {"run": run.run, "status": run.status, "fault": run.fault, "strokes": run.strokes} if run else {}
        )
        plain = {key: getattr(entry, key) for key in ("recording", "athlete", "kind", "month", "duration_s")}
        rows.append({"status": "waiting", **plain, **entry.shown_session(), "started": entry.start, **known})
    order = [("athlete", "ascending"), ("started", "ascending"), ("recording", "ascending")]
    return pa.Table.from_pylist(rows, RECORDINGS).sort_by(order)


def run_rows(records: Sequence[RunRecord]) -> pa.Table:
    """The table of runs."""
    rows = [
        {**{key: getattr(one, key) for key in RUNS.names}, "health": list(one.health.items())}
        for one in records
    ]
    return pa.Table.from_pylist(rows, RUNS).sort_by([("recording", "ascending"), ("run", "ascending")])


def stroke_rows(contents: bytes, entry: Entry, run: RunRecord, where: str) -> pa.Table:
    """Rows of `strokes` of one result; `joined` brings their numbers to float32.

    Raises:
        DataError: the file is damaged.
    """
    found = read_table(
        contents, "; `oarlock season check` lists all damaged files", where, without_lists=True
    )
    names = [field.name for field in found.schema if _is_number(field.type)]
    keys = {
        **{key: getattr(run, key) for key in ("recording", "run", "comparable")},
        "athlete": entry.athlete,
    }
    keys |= {**entry.shown_session(), "started": entry.start}
    count = found.num_rows
    columns = [pa.repeat(pa.scalar(keys[f.name], f.type), count) for f in KEYS if f.name != "stroke"]
    columns.append(pa.array(range(1, count + 1), pa.int32()))
    return pa.Table.from_arrays(
        [*columns, *(found[name] for name in names)],
        [*KEYS.names, *names],
    )


def joined(tables: Sequence[pa.Table]) -> pa.Table:
    """Rows of all tables, whose columns may differ, by athlete, recording and stroke."""
    if not tables:
        return KEYS.empty_table()
    whole = pa.concat_tables(tables, promote_options="permissive")
    columns = [
        column if name in KEYS.names else _known(column)
        for name, column in zip(whole.column_names, whole.columns, strict=True)
    ]
    order = [(key, "ascending") for key in ("athlete", "started", "recording", "stroke")]
    return pa.table(columns, whole.column_names).sort_by(order)


def parquet_bytes(table: pa.Table, about: Mapping[str, str]) -> bytes:
    """The file of a table: float columns split by bytes, texts as indices, groups of rows small enough to skip."""
    numbers = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    out = io.BytesIO()
    parquet.write_table(
        table.replace_schema_metadata(dict(about)),
        out,
        compression="zstd",
        use_dictionary=texts,
        column_encoding=dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
        row_group_size=20_000,
    )
    return out.getvalue()


def utc(moment: datetime.datetime | None) -> datetime.datetime | None:
    """A moment as read from a table, in UTC."""
    return None if moment is None else moment.astimezone(datetime.UTC)


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind))


def _known(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """The numbers as float32; NaN is missing, because DuckDB would carry it into every mean."""
    plain = column.cast(pa.float32())
    return pc.if_else(pc.is_nan(plain), pa.scalar(None, pa.float32()), plain)
