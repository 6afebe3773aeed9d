"""Exports in a season: strokes that count, what an answer leaves out, dates, and names of files and devices."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import season_support as support
from oarlock import Recording
from oarlock.rowing import StrokeTable, load_export
from oarlock.rowing.report.export_piece import ExportPiece
from oarlock.season import Admission, Database, Season, Selection, create_season, left_out, write_season_page
from oarlock.season.add import start_of
from oarlock.season.compute import run_job
from oarlock.season.questions import answer
from oarlock.season.run import make_plan
from oarlock.season.tables import catalogue
from oarlock_lab.synthetic_season import Planned, Synthetic
from season_answers import answered

EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
WHO = "AAAAAA"


@pytest.fixture
def season(tmp_path: Path) -> Season:
    """Of one athlete, with the results of the exports in the examples."""
    season = create_season(str(tmp_path / "season"), "club", "Europe/Berlin")
    support.squad(season, WHO)
    for file in sorted(EXAMPLES.glob("*.csv")):
        Admission(season, WHO, {"Anna Muster": WHO}).add(file)
    for job in make_plan(season).jobs:
        assert run_job(job).status == "done"
    return season


def recordings(database: Database) -> Mapping[str, dict[str, Any]]:
    """Rows of the table by the name of the source."""
    return {row["file"]: row for row in database.rows("FROM recordings")}


def test_strokes_count_as_on_the_page_of_the_export(season: Season) -> None:
    with Database(season) as database:
        known = recordings(database)
        for file, row in known.items():
            piece = ExportPiece(load_export(EXAMPLES / file))
            assert (row["strokes"], row["left_out"]) == (len(piece.table), (~piece.counted).sum())
            values = database.rows(
                f"FROM stroke_values('rate_per_min') WHERE recording = '{row['recording']}'"
            )
            rates = piece.table["rate_per_min"][piece.counted]
            np.testing.assert_allclose([value["value"] for value in values], rates, rtol=1e-6)
        assert (known["rp3.csv"]["strokes"], known["rp3.csv"]["left_out"]) == (22, 13)
        sessions = {row["source"]: row for row in answer(database, "sessions", "rate").to_pylist()}
        assert set(sessions) == {"nk_logbook.csv", "speedcoach_empower.csv"}
        for file, row in sessions.items():
            mean = ExportPiece(load_export(EXAMPLES / file)).averages["rate_per_min"].over.mean
            assert row["mean"] == pytest.approx(mean, rel=1e-6)


def test_results_of_exports_before_this_rule_are_made_again(season: Season) -> None:
    data = catalogue(season).of[0]
    assert make_plan(season).jobs == []
    record = data.records[0]
    former = replace(record, run="ff" * 10, left_out=0)
    assert replace(data, records=(record, former)).current()[record.recording] == record


def test_what_an_answer_leaves_out_is_said_with_its_reason(season: Season, tmp_path: Path) -> None:
    support.add_noise(season, WHO, 1)
    with Database(season) as database:
        strokes, few, waiting = left_out(database, "trend", "rate")
        assert strokes.startswith("39 of 98 strokes do not count")
        assert few.startswith("8 of 11 sessions left out, fewer than 10 strokes that count: ")
        assert "hero.csv of 2021-04-26 (4 of 5 strokes)" in few
        assert waiting.startswith("1 of 11 sessions left out, no result yet")
        assert answer(database, "drift", "rate").num_rows == 0
        assert (
            "10 of 11 sessions left out, fewer than 10 strokes that count in the first and in the last"
            in (" ".join(left_out(database, "drift", "rate")))
        )
        assert "no stroke that counts has this number: " in " ".join(
            left_out(database, "trend", "catch_angle")
        )
        assert "1 of 11 sessions left out, no date: speedcoach_empower.csv (12 of 30 strokes)." in left_out(
            database, "changes", "rate"
        )
        assert "Change not known, because it needs results in 4 months: AAAAAA." in left_out(
            database, "changes", "rate"
        )
        (row,) = answer(database, "changes", "rate").to_pylist()
        assert (row["months"], row["per_month"], row["change"]) == (1, None, None)
        assert left_out(database, "failed") == []
    page = write_season_page(season, tmp_path / "page.html", ["rate"]).read_text("utf-8")
    assert "nan to" not in page
    assert few.replace("'", "&#39;") in page
    assert "no band: no month has two sessions" in page


def test_a_recording_without_a_date_is_on_the_page(season: Season, tmp_path: Path) -> None:
    with Database(season, Selection()) as database:
        assert recordings(database)["rp3.csv"]["started"] is None
        assert {row["month"] for row in answer(database, "trend", "drive_time").to_pylist()} >= {"2021-03"}
    assert "rowed 10 sessions" in write_season_page(season, tmp_path / "page.html").read_text("utf-8")


def test_a_trend_where_there_is_none_is_zero_and_one_of_the_rate_is_seen(tmp_path: Path) -> None:
    def shaped(planned: Planned, table: StrokeTable) -> StrokeTable:
        rate = table["rate_per_min"] + 2.0 * planned.start.month
        travel = np.full(len(table), 0.1 + 0.2)
        return replace(table, columns={**table.columns, "rate_per_min": rate, "seat_travel_m": travel})

    season, current, squad = answered(tmp_path, Synthetic(96, 2, seed=5, strokes=36), shaped)
    with Database(season, tables=current) as database:
        still = answer(database, "changes", "seat_travel").to_pylist()
        assert [(row["per_month"], row["change"], row["changed"]) for row in still] == [(0.0, 0.0, False)] * 2
        months = answer(database, "trend", "rate").to_pylist()
        for row in months:
            # A mean of pieces of 18 to 32/min, not corrected to the usual rate.
            assert row["mean"] == pytest.approx(24.0 + 2.0 * int(row["month"][5:]), abs=0.5)
        assert len(months) == 12 * len(squad)


@pytest.mark.parametrize(
    ("epoch", "date", "start"),
    [
        ("2026-03-04T10:00:00Z", "2026-03-04", "2026-03-04T10:00:00+00:00"),
        ("2026-03-04T23:30:00Z", "2026-03-04", "2026-03-04T23:30:00+00:00"),
        ("2026-03-04T23:30:00Z", "2026-03-05", "2026-03-04T23:30:00+00:00"),
        ("2000-01-01T10:00:00Z", "2026-07-04", "2026-07-04T09:00:00+00:00"),
        ("2000-01-01T10:00:00", "2026-07-04", "2026-07-04T08:00:00+00:00"),
        ("2026-03-04T10:00:00Z", "2026-03-04T07:30", "2026-03-04T06:30:00+00:00"),
    ],
)
def test_a_date_that_a_person_gives_wins_over_the_clock(
    season: Season, epoch: str, date: str, start: str
) -> None:
    moment = start_of(season, epoch, 0.0, {"date": date})
    assert moment is not None and moment.isoformat() == start


def test_a_date_that_replaces_another_is_said(season: Season, tmp_path: Path) -> None:
    other = create_season(str(tmp_path / "other"), "club")
    support.squad(other, WHO, "BBBBBB")
    added = Admission(other, WHO).add(EXAMPLES / "hero.csv", {"date": "2026-05-01"})
    assert added.entry.start == datetime.datetime(2026, 5, 1, 13, 37, 32, tzinfo=datetime.UTC)
    assert added.notes == ["its date is 2026-05-01, not that of its clock, 2021-04-26 13:37 UTC"]
    again = Admission(other, "BBBBBB").add(EXAMPLES / "hero.csv", {"date": "2026-05-02"})
    assert (again.is_new, again.notes) == (False, ["was there before; not changed: athlete, date"])
    assert Admission(other, WHO).add(EXAMPLES / "hero.csv").notes == []
    same = Admission(other, WHO).add(EXAMPLES / "nk_logbook.csv", {"date": "2021-03-30"})
    assert (same.is_new, same.notes) == (True, [])


@pytest.mark.parametrize(
    ("file", "names", "stored"),
    [
        ("outing.csv", {"Anna Muster": WHO}, "outing.csv"),
        ("outing of Muster.csv", {"Anna Muster": WHO}, ""),
        ("with bert.csv", {"Anna Muster": WHO, "Bert Best": "BBBBBB"}, ""),
        ("outing.csv", {"Bert Best": "BBBBBB"}, ""),
        ("outing.csv", {}, ""),
    ],
)
def test_a_file_name_is_stored_if_no_name_of_a_person_is_in_it(
    tmp_path: Path, file: str, names: dict[str, str], stored: str
) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, WHO, "BBBBBB")
    source = tmp_path / file
    source.write_bytes((EXAMPLES / "rp3.csv").read_bytes())
    entry = Admission(season, WHO, names).add(source).entry
    assert (entry.device, entry.file) == ("RP3 or RowPerfect", stored)
    assert season.entry(WHO, entry.recording) == entry
    assert [row.get("file") for row in catalogue_rows(season)] == [stored or None]
    named = [name for name, _ in season.place.files() if source.stem.encode() in season.place.read(name)]
    assert bool(named) == bool(stored)


def catalogue_rows(season: Season) -> list[dict[str, Any]]:
    """Rows of the table of recordings."""
    with Database(season) as database:
        return database.rows("FROM recordings")


def test_a_recording_names_its_format_and_folder(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, WHO)
    noise = support.noise(1)
    Recording(noise.streams, {**noise.meta, "source": {"format": "mtmanager"}}).save(tmp_path / "trial_1")
    entry = Admission(season, WHO, {"Anna": WHO}).add(tmp_path / "trial_1").entry
    assert (entry.device, entry.file) == ("mtmanager", "trial_1")
