"""Tables of a synthetic season with known truth, made without storing its recordings one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest

from oarlock.rowing import StrokeTable
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season import Entry, RunRecord, Season
from oarlock.season.storage import FolderStorage
from oarlock.season.tables import AthleteData, Catalogue, joined, stroke_rows, table_bytes
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
) -> tuple[Season, Catalogue, list[SyntheticAthlete]]:
    """A season, what is in its tables, which are those of a synthetic one, and its athletes with their truth."""
    season, squad = Season(FolderStorage(folder), "synthetic", what.id), what.squad()
    entries: dict[str, dict[str, Entry]] = {one.athlete.pseudonym: {} for one in squad}
    records: dict[str, list[RunRecord]] = {name: [] for name in entries}
    tables: dict[str, list[pa.Table]] = {name: [] for name in entries}
    for one in plan(what.seed, squad, what.recordings, what.classes):
        who, setup = squad[one.member], SETUPS[one.calibrated]
        name = who.athlete.pseudonym
        session = {"boat": who.boat, "seat": who.seat, "rig": one.rig}
        entry = Entry(f"{one.index:05d}", name, "recording", one.start, 2.0, session)
        contents = strokes_parquet(spoil(one, strokes(what.seed, one, who, what.strokes)))
        record = RunRecord.done(
            entry.recording, setup, ENGINE, contents, what.strokes, health(what.seed, one)
        )
        entries[name][entry.recording] = entry
        if one.failed:
            records[name].append(replace(record, status="failed", fault="no strokes", strokes=0))
            continue
        records[name].append(record)
        tables[name].append(stroke_rows(contents, entry, record, "strokes"))
    found = []
    for who in squad:
        name = who.athlete.pseudonym
        season.put_athlete(who.athlete)
        data = AthleteData(who.athlete, "", entries[name], records[name])
        season.place.write(data.file, table_bytes(joined(tables[name]), data))
        found.append(data)
    return season, Catalogue(found), squad


def ask_of(patch: pytest.MonkeyPatch, tables: Catalogue) -> None:
    """Questions are asked of these tables."""

    def of(season: Season, athlete: str | None = None) -> Catalogue:
        return Catalogue([one for one in tables.of if athlete in (None, one.athlete.pseudonym)])

    patch.setattr("oarlock.season.database.update_tables", of)
