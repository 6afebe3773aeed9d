"""A season's store: what is in it is there as a whole, once, under a pseudonym; tables follow what is stored."""

from __future__ import annotations

import datetime
import json
import time
from pathlib import Path

import numpy as np
import pytest

import season_support as support
from command_line import run
from oarlock import DataError, Recording
from oarlock.season import Admission, RunRecord, Season, Setup, create_season, open_season, season_summary
from oarlock.season.database import Database
from oarlock.season.storage import FolderStorage
from oarlock.season.tables import catalogue, update_tables
from oarlock.season.upkeep import check, prune, repair
from oarlock.storage.write_file import TEMPORARY


@pytest.fixture
def season(season_address: str) -> Season:
    season = create_season(season_address, "club", "Europe/Berlin")
    support.squad(season, "AAAAAA", "BBBBBB")
    return season


@pytest.fixture
def disk_season(tmp_path: Path) -> Season:
    season = create_season(str(tmp_path / "season"), "club", "Europe/Berlin")
    support.squad(season, "AAAAAA", "BBBBBB")
    return season


def rows(season: Season, name: str) -> list[dict[str, object]]:
    """Rows of a table."""
    with Database(season) as database:
        found: list[dict[str, object]] = database.table(f"FROM {name}").to_pylist()
        return found


def current_runs(season: Season) -> set[object]:
    """Runs whose strokes are in the tables."""
    return {row["run"] for row in rows(season, "strokes")}


def test_a_recording_is_stored_once_and_opens_like_any_other(season: Season, tmp_path: Path) -> None:
    support.noise(1).save(tmp_path / "trial")
    first = Admission(season, "AAAAAA").add(tmp_path / "trial", {"seat": "2"})
    assert first.is_new
    again = Admission(season, "BBBBBB").add(tmp_path / "trial")
    assert (again.is_new, again.entry.athlete) == (False, "AAAAAA")
    stored = support.copied(season, first.entry.folder, tmp_path / "copy")
    from oarlock import load_recording

    np.testing.assert_array_equal(
        load_recording(stored)["trunk"].gyro_rad_s, support.noise(1)["trunk"].gyro_rad_s
    )
    assert load_recording(stored).meta["session"] == {"athlete": "AAAAAA", "seat": "2"}
    assert first.entry.start == datetime.datetime(2026, 3, 4, 10, tzinfo=datetime.UTC)
    assert check(open_season(season.place.address)) == []


def test_its_name_follows_from_the_numbers_and_the_moment_alone(season: Season) -> None:
    from oarlock.season.add import content_name

    one = support.noise(1)
    assert content_name(one) == content_name(Recording(one.streams, {**one.meta, "note": "x"}))
    assert content_name(one) != content_name(support.noise(2))
    assert content_name(one) != content_name(support.noise(1, "2026-03-05"))


@pytest.mark.parametrize(
    ("epoch", "session", "start"),
    [
        ("2026-03-04T10:00:00Z", {}, "2026-03-04T10:00:00+00:00"),
        ("2026-03-04T10:00:00", {}, "2026-03-04T09:00:00+00:00"),
        ("10:30:00", {"date": "2026-07-04"}, "2026-07-04T08:30:00+00:00"),
        (None, {"date": "2026-07-01"}, "2026-07-01T10:00:00+00:00"),
        ("10:30:00", {}, None),
        (None, {}, None),
    ],
)
def test_the_start_is_in_utc(
    season: Season, epoch: str | None, session: dict[str, str], start: str | None
) -> None:
    from oarlock.season.add import start_of

    found = start_of(season, epoch, 0.0, session)
    assert (None if found is None else found.isoformat()) == start


def test_names_of_people_are_refused_unless_a_mapping_replaces_them(season: Season) -> None:
    one = support.noise(1)
    with pytest.raises(DataError, match=r'the athlete "Anna Muster" is not a pseudonym.*--names FILE'):
        Admission(season).add_recording(one, {"athlete": "Anna Muster"})
    with pytest.raises(DataError, match="does not say who was recorded"):
        Admission(season).add_recording(one, {})
    with pytest.raises(DataError, match="the pseudonym ZZZZZZ, which this season does not have"):
        Admission(season, names={"Anna Muster": "ZZZZZZ"}).add_recording(one, {"athlete": "Anna Muster"})
    mapped = Admission(season, names={"Anna Muster": "BBBBBB"})
    with pytest.raises(DataError, match=r"recording\.toml contains the name"):
        mapped.add_recording(Recording(one.streams, {"by": "anna muster"}), {"athlete": "Anna Muster"})
    assert season.recordings() == {}
    found = mapped.add_recording(Recording(one.streams, {**one.meta, "athlete": "Anna Muster"}), {})
    assert found.entry.athlete == "BBBBBB"
    assert not any(b"Anna" in season.place.read(name) for name, _ in season.place.files())


def test_an_export_keeps_no_name_of_its_own_or_of_people(season: Season, tmp_path: Path) -> None:
    source = Path(__file__).parents[1] / "examples/strokes/rp3.csv"
    export = tmp_path / "Anna Muster.csv"
    export.write_bytes(source.read_bytes())
    added = Admission(season, "AAAAAA").add(export, {"date": "2026-05-01"})
    assert (added.entry.kind, list(added.entry.files)) == ("export", ["export.csv"])
    assert not any("Anna" in name for name, _ in season.place.files())
    text = tmp_path / "not.csv"
    text.write_text("a,b\n1,2\n")
    with pytest.raises(DataError):
        Admission(season, "AAAAAA").add(text)
    assert len(season.recordings()) == 1


def test_tables_follow_what_is_stored(season: Season, tmp_path: Path) -> None:
    march, april = (support.add_noise(season, "AAAAAA", k, f"2026-0{k + 3}-04") for k in range(2))
    support.add_strokes(season, march, tmp_path, 1)
    update_tables(season)
    strokes = rows(season, "strokes")
    assert [row["stroke"] for row in strokes] == [1, 2, 3, 4, 5]
    assert {row["athlete"] for row in strokes} == {"AAAAAA"}
    assert strokes[4]["rate_per_min"] is None
    assert strokes[2]["catch_angle_rad"] == pytest.approx(-1.012, abs=1e-7)  # float32
    assert strokes[2]["catch_angle_rad_std"] == pytest.approx(0.01, abs=1e-8)
    assert {row["recording"]: (row["status"], row["month"]) for row in rows(season, "recordings")} == {
        march: ("done", "2026-03"),
        april: ("waiting", "2026-04"),
    }
    before = {name: season.place.read(name) for name in tables_of(season)}
    assert update_tables(season) == catalogue(season)
    assert {name: season.place.read(name) for name in tables_of(season)} == before
    support.add_strokes(season, april, tmp_path, 2)
    assert len(rows(season, "strokes")) == 10
    changed = {name for name in before if season.place.read(name) != before[name]}
    assert changed == {"athlete=AAAAAA/strokes.parquet"}


def tables_of(season: Season) -> list[str]:
    """Names of the tables of strokes."""
    return [f"athlete={name}/strokes.parquet" for name in season.athletes()]


def test_any_program_reads_the_tables_by_their_folders(disk_season: Season, tmp_path: Path) -> None:
    import duckdb

    for seed, athlete in enumerate(("AAAAAA", "BBBBBB")):
        support.add_strokes(disk_season, support.add_noise(disk_season, athlete, seed), tmp_path, seed)
    update_tables(disk_season)
    files = f"{tmp_path}/season/athlete=*/strokes.parquet"
    query = f"SELECT athlete, min(catch_angle_rad) FROM read_parquet('{files}', hive_partitioning = true) GROUP BY 1"
    found = dict(duckdb.sql(query).fetchall())
    assert found == {"AAAAAA": pytest.approx(-1.004), "BBBBBB": pytest.approx(-1.014)}


def test_the_current_run_is_of_the_newest_engine_or_of_the_seasons_setup(
    season: Season, tmp_path: Path
) -> None:
    one = support.add_noise(season, "AAAAAA", 1)
    old = support.add_strokes(season, one, tmp_path, 1, "0.9.0")
    new = support.add_strokes(season, one, tmp_path, 2, "0.10.0")
    other = support.add_strokes(season, one, tmp_path, 3, "0.1.0", Setup(model=b"another"))
    assert current_runs(season) == {new}
    pinned = Season(**{**vars(season), "setup": Setup(model=b"another").name})
    assert current_runs(pinned) == {other}
    would = prune(pinned, datetime.date(2026, 4, 1))
    assert sorted(name.folder.rpartition(".")[2] for name in would) == sorted([old, new])
    assert len(season.results_of("AAAAAA")) == 3
    prune(pinned, datetime.date(2026, 4, 1), dry_run=False)
    assert season.results_of("AAAAAA") == [(one, other)]


def test_a_result_takes_the_place_of_a_failure_in_the_tables(season: Season, tmp_path: Path) -> None:
    one = support.add_noise(season, "AAAAAA", 1)
    failed = RunRecord(
        one, support.SETUP.run("0.1.0"), "0.1.0", support.SETUP.name, "c", "failed", "no strokes"
    )
    season.put_result("AAAAAA", failed, {}, support.SETUP)
    assert [row["fault"] for row in rows(season, "failed")] == ["no strokes"]
    season.place.remove_folder(f"athlete=AAAAAA/results/{one}.{failed.run}")
    support.add_strokes(season, one, tmp_path, 1)
    assert rows(season, "failed") == []
    assert len(rows(season, "strokes")) == 5


def test_what_stopped_writers_left_is_pruned_after_an_hour(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = support.add_noise(season, "AAAAAA", 1)
    support.add_strokes(season, one, tmp_path, 1)
    update_tables(season)
    stays = sorted(name for name, _ in season.place.files())
    top = "athlete=AAAAAA"
    left = [
        f"{top}/results/abc.def/run.parquet",
        f"{top}/{TEMPORARY}x",
        f"{top}/recordings/{one}/{TEMPORARY}y",
        f"{top}/recordings/{'0' * 20}/a.parquet",
    ]
    for name in left:
        season.place.write(name, b"half")
    day = datetime.date(2026, 4, 1)
    assert prune(season, day) == []
    assert [fault.what for fault in check(season)] == ["unfinished"] * 3  # a table's is on its way
    monkeypatch.setattr("oarlock.season.upkeep._LEFT_S", -1.0)
    assert [one.bytes for one in prune(season, day, dry_run=False)] == [4, 4, 4, 4]
    assert sorted(name for name, _ in season.place.files()) == stays


def test_retention_removes_raw_data_and_keeps_strokes(season: Season, tmp_path: Path) -> None:
    old = support.add_noise(season, "AAAAAA", 1, "2025-01-31")
    new = support.add_noise(season, "AAAAAA", 2, "2026-03-01")
    support.add_strokes(season, old, tmp_path, 1)
    short = Season(**{**vars(season), "retention": {"raw": 12}})
    prune(short, datetime.date(2026, 3, 4), dry_run=False)
    assert [one.what for one in check(short)] == []
    assert len(rows(short, "strokes")) == 5
    folder = "athlete=AAAAAA/recordings"
    assert {name.split("/")[2] for name, _ in season.place.files(folder) if name.endswith(".parquet")} == {
        new
    }
    assert prune(short, datetime.date(2026, 3, 4)) == []


def test_a_damaged_result_is_a_row_and_check_names_every_damage(season: Season, tmp_path: Path) -> None:
    one, two = (support.add_noise(season, "AAAAAA", k) for k in range(2))
    runs = [support.add_strokes(season, name, tmp_path, k) for k, name in enumerate((one, two))]
    top = "athlete=AAAAAA"
    damaged = f"{top}/results/{one}.{runs[0]}/strokes.parquet"
    season.place.write(damaged, season.place.read(damaged)[:-9])
    season.place.write(f"{top}/recordings/{two}/trunk.parquet", b"PAR1")
    update_tables(season)
    known = {row["recording"]: row for row in rows(season, "recordings")}
    assert known[one]["status"] == "failed"
    assert "strokes.parquet: is damaged: its SHA-256 differs" in str(known[one]["fault"])
    assert known[two]["status"] == "done"
    found = check(season)
    assert {(one.what, one.name) for one in found} == {
        ("damaged", damaged),
        ("damaged", f"{top}/recordings/{two}/trunk.parquet"),
    }
    assert repair(season, found) == [f"{top}/results/{one}.{runs[0]}"]
    assert [one.name for one in check(season)] == [f"{top}/recordings/{two}/trunk.parquet"]
    assert season_summary(season).counts["waiting for `oarlock season run`"] == 1


def test_a_damaged_table_is_named_and_made_again(season: Season, tmp_path: Path) -> None:
    support.add_strokes(season, support.add_noise(season, "AAAAAA", 1), tmp_path, 1)
    before = rows(season, "strokes")
    file = "athlete=AAAAAA/strokes.parquet"
    whole = season.place.read(file)
    season.place.write(file, whole[:-9])  # without its end it is made from the results again
    assert [(one.what, one.name) for one in check(season)] == [("damaged", file)]
    assert rows(season, "strokes") == before
    assert check(season) == []
    season.place.write(file, whole[:200] + bytes(200) + whole[400:])
    with pytest.raises(DataError, match=r"cannot be answered: .*season check .* --repair"):
        rows(season, "strokes")
    found = check(season)
    assert [(one.what, one.name) for one in found] == [("damaged", file)]
    assert repair(season, found) == [file]
    assert rows(season, "strokes") == before
    assert check(season) == []


def test_tables_of_another_schema_are_made_anew(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    support.add_strokes(season, support.add_noise(season, "AAAAAA", 1), tmp_path, 1)
    update_tables(season)
    file = "athlete=AAAAAA/strokes.parquet"
    before = season.place.read(file)
    monkeypatch.setattr("oarlock.season.tables.SCHEMA", 99)
    assert rows(season, "strokes")[0]["catch_angle_rad"] == pytest.approx(-1.01)
    assert season.place.read(file) != before


def test_a_recording_of_two_athletes_is_named(season: Season) -> None:
    """Two people add the same file for different athletes at the same moment."""
    one, other = Admission(season, "AAAAAA"), Admission(season, "BBBBBB")
    name = one.add_recording(support.noise(1), {}).entry.recording
    assert other.add_recording(support.noise(1), {}).is_new
    assert [(found.what, found.name) for found in check(season)] == [
        ("unknown", f"athlete=BBBBBB/recordings/{name}")
    ]


def test_a_season_begins_only_in_an_empty_place(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("")
    with pytest.raises(DataError, match="holds other files, such as x"):
        create_season(str(tmp_path), "club")
    with pytest.raises(DataError, match=r"is not a season. To begin one: `oarlock season init"):
        open_season(str(tmp_path))
    with pytest.raises(DataError, match='"Mars/One" is no time zone'):
        create_season(str(tmp_path / "y"), "club", "Mars/One")
    create_season(str(tmp_path / "y"), "club")
    with pytest.raises(DataError, match="is a season already"):
        create_season(str(tmp_path / "y"), "club")


def test_no_name_leads_out_of_the_season(tmp_path: Path) -> None:
    for name in ("../x", "/etc/passwd", "a//b", "a/./b", "a\\b"):
        with pytest.raises(DataError, match="no name inside a season"):
            FolderStorage(tmp_path).read(name)


def test_a_writer_killed_at_any_moment_leaves_a_season_in_order(disk_season: Season, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    for round_ in range(4):
        with support.writer(tmp_path / "season", 1000 * round_) as one:
            support.wait_for(one, int(rng.integers(1, 5)))
            time.sleep(rng.uniform(0.0, 0.02))
        assert {one.what for one in check(disk_season)} <= {"unfinished"}
    assert len(disk_season.recordings()) >= 4
    assert len(update_tables(disk_season).entries) == sum(
        1 for _ in disk_season.entries("AAAAAA", disk_season.recordings())
    )


def test_two_writers_of_the_same_recordings_store_each_once(disk_season: Season, tmp_path: Path) -> None:
    with support.writer(tmp_path / "season", 0) as one, support.writer(tmp_path / "season", 0) as two:
        support.wait_for(one, 20)
        support.wait_for(two, 20)
    assert {one.what for one in check(disk_season)} <= {"unfinished"}
    names = disk_season.recordings()
    from oarlock.season.add import content_name

    expected = [content_name(support.noise(k, support.day(k % 300))) for k in range(len(names))]
    assert sorted(names) == sorted(expected)
    whole = sum(1 for _ in disk_season.entries("AAAAAA", names))
    assert whole >= 20
    assert len(names) - whole <= 2  # at which the two writers were stopped


def test_the_verbs_answer(tmp_path: Path) -> None:
    at, names = tmp_path / "club", tmp_path / "names.toml"
    begun = json.loads(
        run("season", "init", at, "--name", "Club", "--time-zone", "Europe/Berlin", "--json").stdout
    )
    assert (begun["season"], begun["name"]) == (str(at), "Club")
    who = ("--name", "Anna Muster", "--names", names, "--stature-m", 1.8, "--consent", "coaching")
    pseudonym = run("season", "athlete", at, *who).stdout.strip()
    support.noise(1).save(tmp_path / "trial")
    (tmp_path / "trial/session.toml").write_text('athlete = "Anna Muster"\n')
    refused = run("season", "add", at, tmp_path / "trial", status=1)
    assert "is not a pseudonym of this season" in " ".join(refused.stdout.split())
    added = run("season", "add", at, tmp_path / "trial", "--names", names, "--boat", "1x", "--json")
    [stored] = json.loads(added.stdout)["stored"]
    assert (stored["athlete"], stored["is_new"]) == (pseudonym, True)
    listed = json.loads(run("season", "list", at, "--json").stdout)
    assert (listed["counts"]["recordings"], listed["athletes"][0]["athlete"]) == (1, pseudonym)
    assert json.loads(run("season", "check", at, "--json").stdout)["in_order"]
    pruned = json.loads(run("season", "prune", at, "--dry-run", "--json").stdout)
    assert (pruned["dry_run"], pruned["folders"], pruned["bytes"]) == (True, 0, 0)
    trunk = next(at.glob("athlete=*/recordings/*/trunk.parquet"))
    trunk.write_bytes(trunk.read_bytes()[:-1])
    [finding] = json.loads(run("season", "check", at, "--json", status=1).stdout)["findings"]
    assert (finding["what"], finding["name"]) == ("damaged", trunk.relative_to(at).as_posix())
    assert (
        "such as Europe/Berlin"
        in run("season", "init", tmp_path / "x", "--time-zone", "Mars", status=1).output
    )
