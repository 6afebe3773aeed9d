"""An athlete is erased from a season for good: everything goes, and a listing and a query of all tables prove it."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path

import pytest

import season_support as support
from command_line import run
from oarlock import DataError
from oarlock.season import Admission, Athlete, NamesFile, Season, Setup, create_season, open_season
from oarlock.season.erase import Erasure, erase
from oarlock.season.exports import export_athlete
from oarlock.season.records import CURRENT_FILE, Entry
from oarlock.season.run import Ended, Job, Reply, RunLog
from oarlock.season.storage import FolderStorage
from oarlock.season.tables import catalogue, update_tables
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
    return [entry.recording for entry in season.entries(season.recordings()) if entry.athlete == athlete]


def gone(season: Season) -> Erasure:
    return erase(season, GONE, dry_run=False)


def everything(folder: Path) -> bytes:
    return b"\n".join(str(file).encode() + file.read_bytes() for file in folder.rglob("*") if file.is_file())


def test_all_of_an_athlete_goes_and_nothing_of_others(season: Season, tmp_path: Path, state: Path) -> None:
    mine, others = of(season, GONE), of(season, STAYS)
    pinned = Season(**{**vars(season), "setup": {GONE: OWN.name}})
    season.place.write("season.toml", pinned.toml())
    for athlete in (GONE, STAYS):
        export_athlete(season, athlete, tmp_path / "exports")
    before = erase(pinned, GONE)
    assert before.removed == {"recordings": 2, "results": 2, "rows": 10, "exports": 1}
    assert sorted(of(season, GONE)) == sorted(mine)
    found = gone(pinned)
    assert (found.is_proven, found.left, found.elsewhere) == (True, [], [])
    assert found.removed["setups"] == 1
    assert not (tmp_path / "exports" / GONE).exists()
    assert (tmp_path / "exports" / STAYS / "strokes.csv").exists()
    text = everything(tmp_path / "season") + everything(state)
    assert not any(name.encode() in text for name in (GONE, *mine, OWN.name))
    assert sorted(season.recordings()) == sorted(others)
    assert check(open_season(str(tmp_path / "season"))) == []
    (tombstone,) = (tmp_path / "season/erased").iterdir()
    first = tombstone.read_bytes()
    assert b"date = " in first and b"recordings" not in first
    with pytest.raises(DataError, match="was erased from this season"):
        support.add_noise(season, GONE, 7)
    with pytest.raises(DataError, match="was erased from this season"):
        season.put_athlete(Athlete(GONE))
    assert gone(season).is_proven  # once more does no harm
    assert tombstone.read_bytes() == first


def test_what_is_not_the_seasons_is_named_and_the_erasure_not_proven(season: Season, tmp_path: Path) -> None:
    place = tmp_path / "season"
    (place / f"notes of {GONE}.txt").write_text("x")
    (place / "recordings" / of(season, STAYS)[0] / f"{GONE}.csv").write_text("x")
    shown = " ".join(run("season", "erase", place, "--athlete", GONE, "--yes", status=1).stdout.split())
    assert f"notes of {GONE}.txt: its name" in shown
    assert f"{GONE}.csv: its name" in shown
    assert "not proven" in shown
    for file in place.rglob(f"*{GONE}*"):
        file.unlink()
    assert gone(season).is_proven


def test_the_proof_queries_every_table(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables that are not compacted keep the rows; each of them is named, and one that is damaged too."""
    current = update_tables(season)
    with monkeypatch.context() as patch:
        patch.setattr("oarlock.season.erase.compact", lambda season: current)
        patch.setattr("oarlock.season.erase._ROUNDS", 1)
        season.place.write("tables/damaged.parquet", b"PAR1 is not enough")
        patch.setattr("oarlock.season.erase.remove_unused", lambda season, older_s: None)
        found = gone(season)
    whats = {one.file: one.what for one in found.left}
    damaged = whats.pop("tables/damaged.parquet")
    assert "cannot be read" in damaged
    assert whats == {
        current.files["recordings"]: "2 rows",
        current.files["runs"]: "2 rows",
        current.files["athletes"]: "1 rows",
        current.files["strokes/month=2026-03"]: "10 rows",
    }
    proof = gone(season)
    assert (proof.is_proven, proof.tables) == (True, 4)
    assert proof.files == len(list(season.place.files("")))


def test_logs_and_half_written_folders_are_cleared(season: Season, tmp_path: Path) -> None:
    mine, other = of(season, GONE), of(season, STAYS)[0]
    lines = [f'{{"recording": "{mine[0]}"}}\n', f'{{"recording": "{other}"}}\n']
    season.place.write("logs/run.jsonl", "".join(lines).encode())
    season.place.write(".new/abc/run.toml", f'recording = "{mine[1]}"\n'.encode())
    season.place.write(".new/abc/strokes.parquet", b"strokes")
    season.place.write(".new/def/run.toml", f'recording = "{other}"\n'.encode())
    season.place.write("tables/strokes/month=2026-03/old.parquet", b"of a compaction that was stopped")
    assert gone(season).is_proven
    assert season.place.read("logs/run.jsonl") == lines[1].encode()
    assert season.place.children(".new") == ["def"]
    season.place.remove_folder(".new/def")
    assert check(season) == []
    assert not any(name.encode() in everything(tmp_path / "season") for name in (GONE, *mine))


def test_what_comes_back_from_a_backup_is_named_and_erased_again(season: Season, tmp_path: Path) -> None:
    place, backup, mine = tmp_path / "season", tmp_path / "backup", of(season, GONE)[0]
    shutil.copytree(place, backup)
    assert gone(season).is_proven
    for name in (f"recordings/{mine}", "athletes"):
        shutil.copytree(backup / name, place / name, dirs_exist_ok=True)
    found = check(season)
    assert [(one.what, one.name) for one in found] == [
        ("erased", f"recordings/{mine}"),
        ("erased", f"athletes/{GONE}.toml"),
    ]
    assert f"--athlete {GONE} --yes" in found[0].words
    assert GONE not in {entry.athlete for entry in catalogue(season).entries.values()}
    assert gone(season).is_proven
    assert check(season) == []


def test_an_add_that_began_before_the_erasure_does_not_win(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = Admission(season, GONE)
    put = season.place.put_folder

    def late(*args: object) -> bool:
        if threading.current_thread() is writer:
            assert gone(season).is_proven
        return put(*args)  # type: ignore[arg-type]

    writer = threading.current_thread()
    monkeypatch.setattr(season.place, "put_folder", late)
    with pytest.raises(DataError, match="was erased from this season while"):
        slow.add_recording(support.noise(50), {})
    assert of(season, GONE) == []
    assert check(season) == []


def test_a_result_that_comes_late_is_not_stored(season: Season, tmp_path: Path) -> None:
    late = of(season, GONE)[0]
    gone(season)
    support.add_strokes(season, late, tmp_path, 3, "0.2.0", OWN)
    assert all(recording != late for recording, _ in season.results())


def test_a_compaction_that_began_before_the_erasure_does_not_win(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    support.add_strokes(season, of(season, STAYS)[0], tmp_path, 9, "0.2.0")
    support.add_strokes(season, of(season, GONE)[0], tmp_path, 9, "0.2.0")
    from oarlock.season import compact as module

    write, is_late = season.place.write, [True]

    def late(name: str, contents: bytes) -> None:
        if name == CURRENT_FILE and is_late.pop() if is_late else False:
            assert gone(season).is_proven
        write(name, contents)

    monkeypatch.setattr(season.place, "write", late)
    update_tables(season)
    assert not is_late
    assert check(season) == []
    assert GONE.encode() not in everything(tmp_path / "season")
    assert module.Current.read(season).files


def test_an_erasure_that_was_interrupted_goes_on(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = of(season, GONE)
    with monkeypatch.context() as patch:
        patch.setattr("oarlock.season.erase.compact", lambda season: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            gone(season)
    assert of(season, GONE) == []
    season.place.write("logs/run.log", f"{mine[0]} took 2 s\n".encode())
    assert gone(season).is_proven
    assert season.place.read("logs/run.log") == b""
    assert not any(name.encode() in everything(tmp_path / "season") for name in (GONE, *mine))


def test_a_run_that_ends_after_an_erasure_logs_nothing_of_it(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine, other = of(season, GONE)[0], of(season, STAYS)[0]
    log = RunLog(season)
    for recording in (mine, other):
        log.ended(Ended(Job("", recording, "", "ff", (), 1.0, 1.0), Reply("done"), "host", 1, 0.5))
    real = type(season.place).write

    def erased_meanwhile(place: FolderStorage, name: str, contents: bytes) -> None:
        """The erasure ends between the log's look at what is there and its writing."""
        monkeypatch.setattr(type(season.place), "write", real)
        assert gone(season).is_proven
        real(place, name, contents)

    monkeypatch.setattr(type(season.place), "write", erased_meanwhile)
    log.write()
    text = season.place.read(log.name).decode()
    assert other in text
    assert mine not in text


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
    assert "Would erase" in run("season", "erase", place, "--athlete", GONE, "--dry-run").stdout
    run("season", "erase", place, "--athlete", GONE, status=2)
    run("season", "erase", place, "--athlete", "NOBODY", "--yes", status=1)
    shown = run("season", "erase", place, "--athlete", GONE, "--names", names.path, "--yes").stdout
    assert f"nothing of {GONE} is left" in shown
    assert f"Removed the name from {names.path}" in " ".join(shown.split())
    assert NamesFile.read(names.path).pseudonyms == {"Bert Best": STAYS}


def test_an_unfinished_recording_is_erased_too(season: Season, tmp_path: Path) -> None:
    one = of(season, GONE)[0]
    entry = season.entry(one)
    assert isinstance(entry, Entry)
    season.place.remove([f"recordings/{one}/entry.toml"])
    assert gone(season).is_proven
    assert not (tmp_path / "season/recordings" / one).exists()
