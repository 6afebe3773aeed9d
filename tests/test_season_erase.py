"""An athlete is erased from a season for good: the folder goes, and a listing proves it."""

from __future__ import annotations

import json
import shutil
import threading
from pathlib import Path

import pytest

import season_support as support
from command_line import run
from oarlock import DataError
from oarlock.season import Admission, NamesFile, Season, Setup, create_season
from oarlock.season.compute import choose_setup
from oarlock.season.erase import Erasure, erase
from oarlock.season.exports import export_athlete
from oarlock.season.run import Ended, Job, Reply, RunLog
from oarlock.season.storage import FolderStorage
from oarlock.season.tables import update_tables
from oarlock.season.upkeep import check

GONE, STAYS = "K7QMVA", "R9TWXB"
OWN = Setup(model=b'name = "sculler"\n', calibration=b"arm = 0.31\n")


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "state"


@pytest.fixture
def season(tmp_path: Path) -> Season:
    season = create_season(str(tmp_path / "season"), "club")
    filled(season, tmp_path)
    return season


def filled(season: Season, scratch: Path) -> dict[str, list[str]]:
    """Two athletes with two recordings each, with results and tables."""
    support.squad(season, GONE, STAYS)
    names: dict[str, list[str]] = {GONE: [], STAYS: []}
    for seed, athlete in enumerate((GONE, STAYS, GONE, STAYS)):
        recording = support.add_noise(season, athlete, seed)
        support.add_strokes(season, recording, scratch, seed, setup=OWN if athlete == GONE else support.SETUP)
        names[athlete].append(recording)
    update_tables(season)
    return names


def of(season: Season, athlete: str) -> list[str]:
    return season.recordings_of(athlete)


def gone(season: Season) -> Erasure:
    return erase(season, GONE, dry_run=False)


def everything(folder: Path) -> bytes:
    return b"\n".join(str(file).encode() + file.read_bytes() for file in folder.rglob("*") if file.is_file())


def test_all_of_an_athlete_goes_and_nothing_of_others(season: Season, tmp_path: Path, state: Path) -> None:
    mine, others = of(season, GONE), of(season, STAYS)
    pinned = choose_setup(season, OWN, GONE)
    for athlete in (GONE, STAYS):
        export_athlete(season, athlete, tmp_path / "exports")
    season.place.write(f"athlete={GONE}/logs/run.jsonl", b"{}")
    season.place.write(f"athlete={GONE}/results/abc.def/strokes.parquet", b"of a writer that was stopped")
    of_others = {name: season.place.read(name) for name, _ in season.place.files(f"athlete={STAYS}")}
    before = erase(pinned, GONE)
    counts = {key: before.removed[key] for key in ("recordings", "results", "exports")}
    assert counts == {"recordings": 2, "results": 3, "exports": 1}
    assert of(season, GONE) == mine
    found = gone(pinned)
    assert (found.is_proven, found.left, found.elsewhere) == (True, [], [])
    assert found.removed["files"] == before.removed["files"] > 10
    assert not (tmp_path / "exports" / GONE).exists()
    assert (tmp_path / "exports" / STAYS / "csv/strokes.csv").exists()
    assert not (tmp_path / f"season/athlete={GONE}").exists()
    text = everything(tmp_path / "season") + everything(state)
    assert not any(name.encode() in text for name in (GONE, *mine, OWN.name))
    assert {name: season.place.read(name) for name, _ in season.place.files(f"athlete={STAYS}")} == of_others
    assert season.recordings() == dict.fromkeys(others, STAYS)
    assert check(season) == []
    with pytest.raises(DataError, match="is not a pseudonym of this season"):
        support.add_noise(season, GONE, 7)
    with pytest.raises(DataError, match=f'no athlete "{GONE}"'):
        gone(season)


def test_what_cannot_be_removed_is_named_and_the_erasure_not_proven(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(FolderStorage, "remove_folder", lambda self, folder, record="": None)
        shown = run("season", "erase", tmp_path / "season", "--athlete", GONE, "--yes", status=1).stdout
        found = gone(season)
    assert f"athlete={GONE}/strokes.parquet" in "".join(shown.split())
    assert "not proven" in " ".join(shown.split())
    assert f"athlete={GONE}/strokes.parquet" in found.left
    assert not found.is_proven
    assert gone(season).is_proven


def test_an_erasure_that_was_interrupted_is_named_and_goes_on(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export_athlete(season, GONE, tmp_path / "exports")
    with monkeypatch.context() as patch:
        patch.setattr(FolderStorage, "remove_folder", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            gone(season)
    assert GONE not in season.athletes()
    assert set(season.recordings()) == set(of(season, STAYS))
    assert [one.athlete.pseudonym for one in update_tables(season).of] == [STAYS]
    assert [(one.what, one.name) for one in check(season)] == [("unfinished", f"athlete={GONE}")]
    assert gone(season).is_proven
    assert not (tmp_path / "exports" / GONE).exists()
    assert GONE.encode() not in everything(tmp_path / "season")


def test_what_comes_back_from_a_backup_is_erased_again(season: Season, tmp_path: Path) -> None:
    place, backup = tmp_path / "season", tmp_path / "backup"
    shutil.copytree(place, backup)
    assert gone(season).is_proven
    shutil.copytree(backup, place, dirs_exist_ok=True)
    assert len(of(season, GONE)) == 2
    assert gone(season).is_proven
    assert check(season) == []


@pytest.mark.parametrize("moment", ["before it is written", "before its commit record"])
def test_an_add_that_began_before_the_erasure_does_not_win(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    slow = Admission(season, GONE)
    method = "put_folder" if moment == "before it is written" else "write"
    original = getattr(season.place, method)

    def late(*args: object) -> bool:
        if threading.current_thread() is writer:
            assert gone(season).is_proven
        return bool(original(*args))

    writer = threading.current_thread()
    monkeypatch.setattr(season.place, method, late)
    with pytest.raises(DataError, match=f"{GONE} was erased from this season meanwhile"):
        slow.add_recording(support.noise(50), {})
    assert not (tmp_path / f"season/athlete={GONE}").exists()
    assert check(season) == []


def test_a_result_that_comes_late_is_not_stored(season: Season, tmp_path: Path) -> None:
    late = of(season, GONE)[0]
    gone(season)
    support.add_strokes(season, late, tmp_path, 3, "0.2.0", OWN, GONE)
    assert not (tmp_path / f"season/athlete={GONE}").exists()


def test_tables_that_are_written_late_are_not_stored(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for athlete in (GONE, STAYS):
        support.add_strokes(season, of(season, athlete)[0], tmp_path, 9, "0.2.0")
    write, is_late = season.place.write, [True]

    def late(name: str, contents: bytes) -> None:
        if name.startswith(f"athlete={GONE}/") and is_late:
            is_late.clear()
            assert gone(season).is_proven
        write(name, contents)

    monkeypatch.setattr(season.place, "write", late)
    assert [one.athlete.pseudonym for one in update_tables(season).of] == [STAYS]
    assert not is_late
    assert check(season) == []
    assert GONE.encode() not in everything(tmp_path / "season")


def test_a_run_that_ends_after_an_erasure_logs_nothing_of_it(season: Season, tmp_path: Path) -> None:
    mine, other = of(season, GONE)[0], of(season, STAYS)[0]
    log = RunLog(season)
    for athlete, recording in ((GONE, mine), (STAYS, other)):
        job = Job("", athlete, recording, "", "ff", (), 1.0, 1.0)
        log.add_job(Ended(job, Reply("done"), "host", 1, 0.5))
    assert gone(season).is_proven
    log.add("finished")
    log.write()
    assert other in season.place.read(f"athlete={STAYS}/{log.name}").decode()
    assert b"finished" in season.place.read(log.name)
    assert not any(name.encode() in everything(tmp_path / "season") for name in (GONE, mine))


def test_exports_elsewhere_are_named(season: Season, tmp_path: Path) -> None:
    for name in ("moved", "kept"):
        export_athlete(season, GONE, tmp_path / name)
    shutil.rmtree(tmp_path / "moved")
    (tmp_path / "kept" / GONE / "mine.txt").write_text("x")
    assert [words.split(": ", 1)[1] for words in sorted(gone(season).elsewhere)] == [
        "contains files that were not exported; look at them",
        "an export that was moved or removed; if it was moved, remove it there",
    ]
    assert [file.name for file in (tmp_path / "kept" / GONE).rglob("*")] == ["mine.txt"]


def test_the_command(season: Season, tmp_path: Path) -> None:
    names = NamesFile(tmp_path / "names.toml", {"Anna Muster": GONE, "Bert Best": STAYS})
    names.write()
    place = tmp_path / "season"
    dry = json.loads(run("season", "erase", place, "--athlete", GONE, "--dry-run", "--json").stdout)
    assert (dry["is_dry_run"], dry["is_proven"], dry["removed"]["recordings"]) == (True, False, 2)
    assert GONE in season.folders()
    run("season", "erase", place, "--athlete", GONE, status=2)
    run("season", "erase", place, "--athlete", "NOBODY", "--yes", status=1)
    shown = run("season", "erase", place, "--athlete", GONE, "--names", names.path, "--yes").stdout
    assert f"nothing of {GONE} is left" in shown
    assert f"Removed the name from {names.path}" in " ".join(shown.split())
    assert NamesFile.read(names.path).pseudonyms == {"Bert Best": STAYS}
