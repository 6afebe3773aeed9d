"""Questions to a season: what was planted is found with honest bands, and what cannot be compared is refused."""

from __future__ import annotations

import datetime
import json
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import season_support as support
from command_line import run
from oarlock import DataError
from oarlock.rowing import StrokeTable
from oarlock.season import QUESTIONS, Athlete, Database, Season, Selection, ask, create_season, trend
from oarlock.season.database import add_functions, metric_named, rate_range
from oarlock.season.questions import answer
from oarlock.season.tables import Catalogue, update_tables
from oarlock_lab.synthetic_season import BASES, REFERENCE_RATE, Synthetic, SyntheticAthlete
from season_answers import answered, ask_of

Squad = list[SyntheticAthlete]
Rows = list[dict[str, Any]]
Drifting = tuple[Database, Squad, Catalogue]
DRIFTING = Synthetic(recordings=24 * 48, athletes=24, seed=11, strokes=72)


@pytest.fixture(scope="module")
def drifting(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A database of 24 athletes, four sessions a month."""
    season, current, squad = answered(tmp_path_factory.mktemp("season [1]"), DRIFTING)
    with Database(season, tables=current) as database:
        yield database, squad, current


def share_within(rows: Rows, truth: dict[str, float]) -> tuple[int, int]:
    """How many bands contain their athlete's truth, and of how many."""
    inside = [row["low"] <= truth[row["athlete"]] <= row["high"] for row in rows if row["athlete"] in truth]
    return sum(inside), len(inside)


def by_athlete(squad: Squad, of: Any) -> dict[str, float]:
    """A number of each athlete; those of which it is None are left out."""
    found = {one.athlete.pseudonym: of(one) for one in squad}
    return {name: value for name, value in found.items() if value is not None}


def test_planted_drifts_are_found_and_nothing_else(drifting: Drifting) -> None:
    database, squad, _ = drifting
    inside = total = 0
    for metric in BASES:
        rows = answer(database, "changes", metric).to_pylist()
        truth = {
            one.athlete.pseudonym: one.drift.get(metric, 0.0) for one in squad if metric not in one.rig_step
        }
        hits, count = share_within(rows, truth)
        inside, total = inside + hits, total + count
        for row in rows:
            if row["athlete"] in truth:
                assert row["changed"] == (truth[row["athlete"]] != 0.0), (metric, row)
    # 95 % of 176 bands, within 3 standard deviations of a binomial count
    assert abs(inside - 0.95 * total) < 3.0 * np.sqrt(total * 0.95 * 0.05)


def test_bands_of_months_contain_the_truth(drifting: Drifting) -> None:
    database, squad, _ = drifting
    named = {one.athlete.pseudonym: one for one in squad}
    rates = database.table(
        "SELECT athlete, avg(rate_per_min) AS rate FROM strokes GROUP BY athlete"
    ).to_pylist()
    usual_rate = {row["athlete"]: row["rate"] for row in rates}
    inside = total = 0
    for metric, base in BASES.items():
        for row in answer(database, "trend", metric).to_pylist():
            one, usual = named[row["athlete"]], usual_rate[row["athlete"]]
            if metric in one.drift or one.rig_step.get(metric):
                continue
            tired = one.fatigue.get(metric, 0.0) / 2.0
            true = one.means[metric] + base.per_rate * (usual - REFERENCE_RATE) + tired
            inside, total = inside + (row["low"] <= true <= row["high"]), total + 1
    # months of one athlete share their estimate of the variance between sessions
    assert total > 1500
    assert 0.93 < inside / total < 0.97


def test_drift_within_a_session(drifting: Drifting) -> None:
    database, squad, _ = drifting
    rows = answer(database, "drift", "catch_angle").to_pylist()
    truth = by_athlete(squad, lambda one: one.fatigue.get("catch_angle_rad", 0.0) * 2.0 / 3.0)
    assert share_within(rows, truth)[0] >= 20
    assert {row["athlete"] for row in rows if row["changed"]} == {
        name for name, true in truth.items() if true
    }


def test_sides_and_rigs(drifting: Drifting) -> None:
    database, squad, _ = drifting
    sides = answer(database, "sides", "catch_angle").to_pylist()
    assert share_within(sides, by_athlete(squad, lambda one: one.sides["catch_angle_rad"]))[0] >= 20
    rigs = answer(database, "rig", "catch_angle").to_pylist()
    stepped = by_athlete(
        squad, lambda one: one.rig_step.get("catch_angle_rad") if "catch_angle_rad" not in one.drift else None
    )
    assert len(stepped) == 3
    assert {row["athlete"] for row in rows_of(rigs, stepped)} == set(stepped)
    assert share_within(rigs, stepped)[0] >= 2
    assert {(row["before"], row["after"]) for row in rigs} == {("spread 1.59", "spread 1.61")}


def rows_of(rows: Rows, truth: dict[str, float]) -> Rows:
    """The rows of these athletes."""
    return [row for row in rows if row["athlete"] in truth]


def test_scatter_grows_with_the_rate_and_rates_are_compared_in_their_class(
    drifting: Drifting,
) -> None:
    database, squad, _ = drifting
    rows = answer(database, "consistency", "seat_travel").to_pylist()
    by_class: dict[float, list[float]] = {}
    for row in rows:
        by_class.setdefault(row["rate_class"], []).append(row["sd"])
    base, noise = BASES["seat_travel_m"], np.mean([row["noise"] for row in rows])
    assert noise == pytest.approx(
        base.measured * 1.4, rel=0.25
    )  # 5 % of the strokes are measured 4 times worse
    means = {rate: np.mean(own) for rate, own in by_class.items() if len(own) == len(squad)}
    assert means[32.0] > means[20.0] > base.strokes
    low = answer(database, "same_rate", "handle_peak_speed", "17-21").to_pylist()
    assert {row["rate_class"] for row in low} <= {18.0, 20.0}
    truth = {one.athlete.pseudonym: one.means["handle_peak_speed_m_s"] for one in squad}
    inside, count = share_within([row for row in low if row["rate_class"] == 20.0], truth)
    assert count == len(squad)
    assert inside >= 20


def test_crews_share_their_start_and_the_late_one_is_named(drifting: Drifting) -> None:
    database, squad, _ = drifting
    rows = answer(database, "crew").to_pylist()
    by_boat = {one.boat: one for one in sorted(squad, key=lambda one: one.seat)}  # the stroke seat stays
    crew = {one.athlete.pseudonym: one for one in squad if one.boat.startswith(("2", "4"))}
    assert {row["boat"] for row in rows} == {one.boat for one in crew.values()}
    inside = 0
    for row in rows:
        own, leader = crew[row["athlete"]], by_boat[row["boat"]]
        month = int(row["month"][5:]) + 12 * int(row["month"][:4]) - (12 * 2025 + 11)
        late = own.late_s - leader.late_s + (own.late_drift_s - leader.late_drift_s) * (month + 0.5)
        slack = 0.5 * abs(own.late_drift_s - leader.late_drift_s)  # sessions are not in the middle of a month
        inside += row["low_s"] - slack <= late <= row["high_s"] + slack
    assert inside / len(rows) > 0.88  # four sessions a month


def test_health_and_failures(drifting: Drifting) -> None:
    database, *_ = drifting
    health = answer(database, "sensor_health").to_pylist()
    assert {row["number"] for row in health} >= {"trunk.missing_share", "gyro_bias_rad_s"}
    assert sum(row["recordings"] for row in health if row["number"] == "gyro_bias_rad_s") == 24 * 48
    failed = answer(database, "failed").to_pylist()
    assert {row["fault"] for row in failed} == {"no strokes"}
    assert len(failed) + database.table("FROM recordings WHERE status = 'done'").num_rows == 24 * 48


def test_a_stroke_counts_by_its_uncertainty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoilt(one: Any, table: StrokeTable) -> StrokeTable:
        bad = np.arange(60) % 10 == 0
        value = table.columns["catch_angle_rad"] + np.where(bad, 0.5, 0.0)
        std = np.where(bad, 5.0, table.stds["catch_angle_rad"])
        return replace(
            table,
            columns={**table.columns, "catch_angle_rad": value},
            stds={**table.stds, "catch_angle_rad": std},
        )

    what = Synthetic(60, 2, seed=3, strokes=60)
    means = []
    for name, spoil in (("plain", lambda one, table: table), ("spoilt", spoilt)):
        season, current, _ = answered(tmp_path / name, what, spoil)
        ask_of(monkeypatch, current)
        means.append(ask(season, "trend", "catch_angle").to_pylist())
    before, after = means
    for one, other in zip(before, after, strict=True):
        # a tenth of the strokes is off by 0.5 rad: an unweighted mean would be off by 0.05
        assert abs(one["mean"] - other["mean"]) < 0.012


def test_what_cannot_be_compared_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    season, current, squad = answered(tmp_path, Synthetic(96, 2, seed=5, classes=2, strokes=30))
    ask_of(monkeypatch, current)
    name = squad[0].athlete.pseudonym
    with pytest.raises(DataError) as caught:
        trend(season, name, "catch_angle")
    words = str(caught.value)
    assert words.startswith(f"{name}: the results are of 2 classes")
    assert "36 recordings)" in words
    assert "12 recordings)" in words
    assert f"--class {ask(season, 'classes')['comparable'][0].as_py()}" in words
    assert "`oarlock season run" in words
    for question in QUESTIONS:
        if question.compares:
            with pytest.raises(DataError, match="cannot be compared"):
                ask(season, question.name, "catch_angle" if question.of_metric else None)
    first = ask(season, "classes")["comparable"][0].as_py()
    found = trend(season, name, "catch_angle", selection=Selection(comparable=first))
    assert (found.comparable, found.months.num_rows) == (first, 9)
    with Database(season) as database:
        rows = database.table("FROM changes('catch_angle_rad')").to_pylist()
    assert len({(row["athlete"], row["comparable"]) for row in rows}) == len(rows) == 4


def test_who_has_not_consented_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    season, current, squad = answered(tmp_path, Synthetic(24, 4, seed=6, strokes=30))
    ask_of(monkeypatch, current)
    names = [one.athlete.pseudonym for one in squad]
    with Database(season, Selection(scope="research")) as database:
        for table in ("strokes", "recordings", "athletes"):
            found = database.table(f"SELECT DISTINCT athlete FROM {table}")["athlete"].to_pylist()
            assert set(found) == set(names[:3])
        assert database.table("FROM runs").num_rows == 18
    with pytest.raises(DataError, match=f"{names[3]} has not consented to research"):
        trend(season, names[3], "catch_angle", selection=Selection(scope="research"))
    with pytest.raises(DataError, match="choose coaching, research or sharing"):
        ask(season, "failed", selection=Selection(scope="all"))


@pytest.mark.parametrize(
    "sql",
    [
        "DROP TABLE runs",
        "CREATE TABLE mine AS SELECT 1",
        "DELETE FROM recordings",
        "COPY recordings TO 'FOLDER/out.csv'",
        "ATTACH 'FOLDER/other.db'",
        "INSTALL httpfs",
        "SET threads = 1",
        "SELECT 1; SELECT 2",
        "SELECT * FROM read_csv('FOLDER/secret.csv')",
        "SELECT * FROM 'FOLDER/secret.csv'",
        "SELECT * FROM glob('FOLDER/*')",
        "SELECT * FROM read_text('FOLDER/secret.csv')",
        "SELECT * FROM sql",
        "SELECT nothing FROM recordings",
        "",
    ],
)
def test_sql_reads_the_tables_and_nothing_else(drifting: Drifting, tmp_path: Path, sql: str) -> None:
    database, *_ = drifting
    (tmp_path / "secret.csv").write_text("a\n1\n")
    rows = database.table("SELECT count(*) AS n FROM recordings")["n"][0].as_py()
    with pytest.raises(DataError):
        database.table(sql.replace("FOLDER", str(tmp_path)))
    assert database.table("SELECT count(*) AS n FROM recordings")["n"][0].as_py() == rows == 24 * 48
    assert [file.name for file in tmp_path.iterdir()] == ["secret.csv"]


def test_names_are_forgiven(drifting: Drifting) -> None:
    database, *_ = drifting
    for text in ("catch_angle", "Catch angle", "catch-angle-rad", "CATCH_ANGLE"):
        assert database.metric(text) == "catch_angle_rad"
    with pytest.raises(DataError, match='Did you mean "catch_angle"'):
        database.metric("catch_angel")
    with pytest.raises(DataError, match="may be a_m or a_s"):
        metric_named("a", ["a_m", "a_s"])
    with pytest.raises(DataError, match='Did you mean "crew"'):
        answer(database, "crw")
    with pytest.raises(DataError, match="the question trend needs a metric"):
        answer(database, "trend")
    assert rate_range("20-24") == rate_range("20 to 24") == (20.0, 24.0)
    for text in ("24-20", "20", "a-b"):
        with pytest.raises(DataError, match="such as 20-24"):
            rate_range(text)


def test_selections(drifting: Drifting, monkeypatch: pytest.MonkeyPatch) -> None:
    database, squad, current = drifting
    ask_of(monkeypatch, current)
    season, name = database.season, squad[0].athlete.pseudonym
    day = datetime.date(2026, 1, 1)
    found = trend(
        season, name, "catch_angle", "20-24", Selection(since=day, until=datetime.date(2026, 2, 28))
    )
    assert found.months["month"].to_pylist() == ["2026-01", "2026-02"]
    assert found.change is None
    assert found.notes[0].startswith("A change is stated from 4 months on")
    assert all(20.0 <= rate <= 24.0 for rate in found.months["rate"].to_pylist())
    stepped = next(one for one in squad if one.rig_step)
    noted = trend(season, stepped.athlete.pseudonym, "catch_angle")
    assert any("changed to spread 1.61 on 2026-" in note for note in noted.notes)
    for selection, words in (
        (Selection(athlete="S"), "no athlete"),
        (Selection(boat="8x"), "no boat"),
        (Selection(comparable="0"), "no class of runs"),
    ):
        with pytest.raises(DataError, match=words):
            ask(season, "failed", selection=selection)


def test_a_season_without_results_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    season.put_athlete(Athlete("AAAAAA"))
    with pytest.raises(DataError, match=r"has no strokes yet; compute them: `oarlock season run`"):
        trend(season, "AAAAAA", "catch_angle")
    assert ask(season, "failed").num_rows == 0
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(DataError, match=r'pip install "oarlock\[season\]"'):
        Database(season)


def test_the_verbs_answer(tmp_path: Path) -> None:
    at = tmp_path / "season"
    made = run("lab", "season", at, "--recordings", 10, "--athletes", 2, "--jobs", 1, "--seed", 4, "--json")
    assert json.loads(made.stdout)["recordings"] == 10
    names = sorted(folder.name.partition("=")[2] for folder in at.glob("athlete=*"))
    listed = run("season", "questions", at).stdout
    assert all(question.name in listed for question in QUESTIONS)
    shown = run(
        "season", "trend", at, "--metric", "catch_angle", "--athlete", names[0], "--rate-spm", "20-24"
    ).stdout
    assert "catch angle, deg" in shown
    assert "per month" in shown
    assert "per month" in run("season", "trend", at, "--metric", "catch_angle").stdout
    drift = json.loads(run("season", "questions", at, "drift", "--metric", "catch_angle", "--json").stdout)
    assert sorted(row["athlete"] for row in drift["rows"]) == names
    table, rows = tmp_path / "rows.csv", tmp_path / "rows.parquet"
    asked = run(
        "season",
        "query",
        at,
        "SELECT recording, health FROM runs",
        "--csv",
        table,
        "--parquet",
        rows,
        "--json",
    )
    assert json.loads(asked.stdout) == {"row_count": 10, "written": [str(table), str(rows)]}
    assert len(table.read_text().splitlines()) == 11
    assert rows.read_bytes()[:4] == b"PAR1"
    again = run("season", "query", at, "SELECT 1", "--csv", table, status=2)
    assert "rows.csv" in again.stderr
    wrong = run("season", "questions", at, "drift", status=2)
    assert "--metric catch_angle" in wrong.stderr


def test_tables_follow_athletes_setups_and_erasures(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA", "BBBBBB")
    for seed, name in enumerate(("AAAAAA", "BBBBBB")):
        support.add_strokes(season, support.add_noise(season, name, seed), tmp_path, seed)
    assert update_tables(season) == update_tables(season)
    season.put_athlete(Athlete("AAAAAA", {"stature_m": 1.7}))
    with Database(season) as database:
        statures = database.table("SELECT athlete, stature_m FROM athletes").to_pylist()
    assert statures == [{"athlete": "AAAAAA", "stature_m": 1.7}, {"athlete": "BBBBBB", "stature_m": 1.8}]
    season.place.remove(["athlete=BBBBBB/athlete.toml"])  # an erasure has begun
    with Database(season) as database:
        for table in ("strokes", "recordings", "athletes"):
            found = database.table(f"SELECT DISTINCT athlete FROM {table}")["athlete"].to_pylist()
            assert found == ["AAAAAA"]
        assert database.table("FROM runs").num_rows == 1
    pinned = Season(**{**vars(season), "setup": "none"})
    assert [one.setup for one in update_tables(pinned).of] == ["none"]
    # a writer that was stopped
    season.place.write(f"athlete=AAAAAA/recordings/{'0' * 20}/left.parquet", b"")
    assert update_tables(pinned) == update_tables(pinned)
    assert len(update_tables(pinned).entries) == 1


def test_crews_match_by_absolute_time() -> None:
    """Recordings that overlap and begin at different moments; the one after them and another boat's have no partner."""
    duckdb = pytest.importorskip("duckdb")
    connection = duckdb.connect(":memory:")
    add_functions(connection)
    connection.execute(
        "CREATE TABLE recordings(recording VARCHAR, athlete VARCHAR, boat VARCHAR, seat VARCHAR, comparable VARCHAR, "
        "month VARCHAR, status VARCHAR, started TIMESTAMPTZ, duration_s DOUBLE)"
    )
    connection.execute("CREATE TABLE caught(recording VARCHAR, value DOUBLE)")
    connection.execute(
        "CREATE MACRO stroke_values(metric) AS TABLE SELECT recording, 24.0 AS rate, value FROM caught"
    )
    begin = datetime.datetime(2026, 5, 1, 6, 0, tzinfo=datetime.UTC)
    given = (
        ("S", "4x", "stroke", 0.0, 0.0),
        ("2", "4x", "2", 7.5, 0.015),
        ("B", "4x", "bow", 0.0, -0.03),
        ("later", "4x", "3", 200.0, 0.0),
        ("other", "2x", "1", 0.0, 0.0),
    )
    for name, boat, seat, after_s, late_s in given:
        started = begin + datetime.timedelta(seconds=after_s)
        row = [name, name, boat, seat, "c", "2026-05", "done", started, 100.0]
        connection.execute("INSERT INTO recordings VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
        rows = [(name, 10.0 + 2.5 * k + late_s - after_s) for k in range(30)]
        connection.executemany("INSERT INTO caught VALUES (?, ?)", rows)
    text = files("oarlock.season").joinpath("views.sql").read_text(encoding="utf-8")
    macro = text[text.index("CREATE MACRO outings()") :]
    connection.execute(macro[: macro.index(";")])
    found = connection.execute("SELECT athlete, late_s, strokes, one_start FROM outings() ORDER BY athlete")
    assert [(name, round(late, 6), count, one) for name, late, count, one in found.fetchall()] == [
        ("2", 0.015, 30, False),
        ("B", -0.03, 30, True),
    ]
