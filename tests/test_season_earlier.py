"""Last time and own best of a season in a report: which piece it is, why others are not, what is said without."""

from __future__ import annotations

import datetime
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import season_support as support
from command_line import run
from oarlock import Track, load_model
from oarlock.rowing import StrokeTable
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season import Admission, Athlete, Entry, RunRecord, Season, Setup, create_season, earlier_pieces
from oarlock.season.compute import make_setup
from oarlock.season.erase import erase
from rowed_truth import rowed

pytest.importorskip("duckdb")
SECONDS = 24.0
ANNA = "AAAAAA"


def session_of(track: Track, **texts: str) -> Track:
    """The track with a session, at the mounts of its model."""
    about = {"session": texts, "nominal_mounts": ["back"], "oarlock": "0.1.0"}
    return replace(track, provenance={**track.provenance, **about})


@pytest.fixture(scope="module")
def track() -> Track:
    return session_of(rowed("B-NB", SECONDS, 24.0, 0), athlete=ANNA, date="2026-05-01")


@pytest.fixture(scope="module")
def tables() -> dict[float, StrokeTable]:
    table = technique(rowed("B-NB", SECONDS, 24.0, 5)).strokes
    fast = replace(table, columns={**table.columns, "rate_per_min": table["rate_per_min"] + 8.0})
    return {24.0: table, 32.0: fast}


def put(season: Season, seed: int, day: str, table: StrokeTable, setup: Setup, engine: str = "0.1.0") -> None:
    """A recording from 10:00 on, with these strokes as its result."""
    recording = Admission(season, ANNA).add_recording(support.noise(seed, day, SECONDS), {"boat": "1x"})
    contents = strokes_parquet(replace(table, curves={}))
    record = RunRecord.done(recording.entry.recording, setup, engine, contents, len(table), {})
    season.put_result(ANNA, record, {"strokes.parquet": contents}, setup)


def put_speed(season: Season, day: str, speed_m_s: float) -> None:
    """An export of a device that measured this speed from 9:59 on for two minutes."""
    start = datetime.datetime.fromisoformat(f"{day}T09:59:00+00:00")
    time_s = np.arange(2.5, 120.0, 2.5)
    entry = Entry(f"{round(100 * speed_m_s):020d}", ANNA, "export", start, 120.0, {"athlete": ANNA})
    season.put_recording(entry, {"export.csv": day.encode()})
    columns = {"time_s": time_s, "speed_m_s": np.full(47, speed_m_s), "rate_per_min": np.full(47, 24.0)}
    contents = strokes_parquet(StrokeTable(columns, source="a.csv: NK SpeedCoach"))
    record = RunRecord.done(entry.recording, Setup(), "0.1.0", contents, 47, {})
    season.put_result(ANNA, record, {"strokes.parquet": contents}, Setup())


@pytest.fixture
def season(tmp_path: Path, tables: dict[float, StrokeTable]) -> Season:
    """Rate 24 on 1 and 8 April, the first of them faster; rate 32 on 20 April; one after the track."""
    made = create_season(str(tmp_path / "season"), "Club 2026")
    support.squad(made, ANNA)
    setup = make_setup(load_model("sculler"))
    for seed, (day, rate) in enumerate(
        [("2026-04-01", 24.0), ("2026-04-08", 24.0), ("2026-04-20", 32.0), ("2026-05-02", 24.0)]
    ):
        put(made, seed, day, tables[rate], setup)
    for day, speed in (("2026-04-01", 4.31), ("2026-04-08", 4.12), ("2026-04-20", 5.0), ("2026-05-02", 4.9)):
        put_speed(made, day, speed)
    return made


def test_the_latest_comparable_and_the_fastest_at_this_rate(season: Season, track: Track) -> None:
    found = earlier_pieces(season, track)
    assert found.last is not None and found.last.name.startswith("8 April 2026, 10:00, ")
    assert found.best is not None and found.best.date == "2026-04-01"
    said = " ".join(found.notes)
    assert "Later, but not compared: 20 April 2026, 10:00 has 32/min, this piece 24/min" in said
    assert "4.31 m/s" in said and "Wind and stream" in said
    # Standard deviations come with the strokes: a difference has an uncertainty.
    assert found.last.averages["arc_rad"].over.std > 0.0


def test_the_page_and_the_terminal_say_which(season: Season, track: Track, tmp_path: Path) -> None:
    track.save(tmp_path / "out")
    place = season.place.address
    result = run("report", tmp_path / "out", "--season", place)
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "8 April 2026, 10:00" in page and "4.31 m/s" in page and "Not compared with" not in page
    assert "Last time: 8 April 2026, 10:00" in result.stdout and "4.31 m/s" in result.stdout
    own = run("report", tmp_path / "out", "--season", place, "--last", tmp_path / "out", "--force", "--json")
    assert [note[:8] for note in json.loads(own.stdout)["season"]] == ["Own best"]


def test_a_name_is_looked_up_and_its_pseudonym_is_not_shown(season: Season, track: Track) -> None:
    named = session_of(track, athlete="Anna Muster", date="2026-05-01")
    assert "--names" in earlier_pieces(season, named).notes[0]
    found = earlier_pieces(season, named, {"Anna Muster": ANNA})
    assert found.last is not None and ANNA not in f"{found.last.name} {found.notes}"


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ({"date": "2026-05-01"}, "does not say whose it is"),
        ({"athlete": "BBBBBB", "date": "2026-05-01"}, "nothing of BBBBBB"),
        ({"athlete": ANNA}, "date of this piece is not known"),
        ({"athlete": ANNA, "date": "2026-04-01"}, "no earlier piece"),
    ],
)
def test_without_one_a_sentence_says_why(
    season: Season, track: Track, texts: dict[str, str], said: str
) -> None:
    found = earlier_pieces(season, session_of(track, **texts))
    assert found[:2] == (None, None) and said in found.notes[0]


def test_other_engines_and_calibrations_do_not_compare(
    tmp_path: Path, track: Track, tables: dict[float, StrokeTable]
) -> None:
    season = create_season(str(tmp_path / "other"), "other")
    season.put_athlete(Athlete(ANNA))
    setup = make_setup(load_model("sculler"))
    put(season, 1, "2026-04-01", tables[24.0], setup, engine="0.0.9")
    put(season, 2, "2026-04-02", tables[24.0], make_setup(load_model("sweep")))
    found = earlier_pieces(season, track)
    assert found.last is None and found.best is None
    assert "computed by Oarlock 0.0.9" in found.notes[1] and "is sweep, this piece sculling" in found.notes[1]
    put(season, 3, "2026-04-03", tables[24.0], setup)
    mounted = replace(track, provenance={**track.provenance, "nominal_mounts": []})
    assert "is not calibrated, this piece is" in earlier_pieces(season, mounted).notes[1]
    alone = earlier_pieces(season, track)
    assert alone.last is not None and "none is claimed" in alone.notes[-1]


def test_the_erased_stay_erased(
    season: Season, track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert earlier_pieces(season, track).last is not None
    erase(season, ANNA, dry_run=False)
    assert earlier_pieces(season, track).notes[0].startswith("Not compared")
