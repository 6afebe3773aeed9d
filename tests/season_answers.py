"""Tables of a synthetic season with known truth, made without storing its recordings one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest

from oarlock.rowing import StrokeTable
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season import Entry, Season
from oarlock.season.add import done_record
from oarlock.season.compact import Current, athlete_rows
from oarlock.season.disk import FolderStorage
from oarlock.season.schema import joined, parquet_bytes, recording_rows, run_rows, stroke_rows
from oarlock_lab.synthetic_season import (
    ENGINE,
    SETUPS,
    Planned,
    Synthetic,
    SyntheticAthlete,
    health,
    plan,
    strokes,
)

Spoil = Callable[[Planned, StrokeTable], StrokeTable]


def answered(
    folder: Path, what: Synthetic, spoil: Spoil = lambda one, table: table
) -> tuple[Season, Current, list[SyntheticAthlete]]:
    """A season, its tables, which are those of a synthetic one, and its athletes with their truth."""
    season, squad = Season(FolderStorage(folder), "synthetic", what.id), what.squad()
    entries, records, tables = [], [], []
    for one in plan(what.seed, squad, what.recordings, what.classes):
        who, setup = squad[one.member], SETUPS[one.calibrated]
        session = {"boat": who.boat, "seat": who.seat, "rig": one.rig}
        entry = Entry(f"{one.index:05d}", who.athlete.pseudonym, "recording", one.start, 2.0, session)
        contents = strokes_parquet(spoil(one, strokes(what.seed, one, who, what.strokes)))
        record = done_record(entry.recording, setup, ENGINE, contents, what.strokes, health(what.seed, one))
        entries.append(entry)
        if one.failed:
            records.append(replace(record, status="failed", fault="no strokes", strokes=0))
            continue
        records.append(record)
        tables.append(stroke_rows(contents, entry, record, "strokes"))
    current = {record.recording: record for record in records}
    athletes = {one.athlete.pseudonym: one.athlete for one in squad}
    found = {
        "recordings": recording_rows(entries, current),
        "runs": run_rows(records),
        "athletes": athlete_rows(athletes),
        "strokes/month=all": joined(tables),
    }
    for athlete in athletes.values():
        season.put_athlete(athlete)
    files = {name: _put(season, name, table) for name, table in found.items()}
    return season, Current(files=files), squad


def compacted(patch: pytest.MonkeyPatch, current: Current) -> None:
    """Questions are asked of these tables."""
    patch.setattr("oarlock.season.questions.database.compact", lambda season: current)


def _put(season: Season, name: str, table: pa.Table) -> str:
    file = f"tables/{name}.parquet"
    season.place.write(file, parquet_bytes(table, {}))
    return file
