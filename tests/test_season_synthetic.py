"""A synthetic season: the same parameters give the same bytes, however often it was stopped."""

from __future__ import annotations

from pathlib import Path

import pytest

from oarlock import DataError, load_recording
from oarlock.season import open_season
from oarlock.season.records import recording_folder, result_folder
from oarlock.season.tables import update_tables
from oarlock.season.upkeep import check
from oarlock_lab.synthetic_season import Synthetic, make_synthetic, plan, strokes, synthetic_squad

SMALL = Synthetic(recordings=7, athletes=3, seed=2, strokes=30)


def files(folder: Path) -> dict[str, bytes]:
    """Contents by name."""
    return {
        file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()
    }


def test_one_seed_gives_one_season_also_after_a_stop(tmp_path: Path) -> None:
    shares: list[float] = []
    make_synthetic(str(tmp_path / "whole"), SMALL, jobs=1, progress=shares.append)
    assert shares[-1] == 1.0
    season = make_synthetic(str(tmp_path / "stopped"), SMALL, jobs=1)
    who, *_ = season.athletes()
    for recording, run in season.results_of(who)[:2]:
        season.place.remove_folder(result_folder(who, recording, run))
    season.place.remove_folder(recording_folder(who, recording))
    make_synthetic(str(tmp_path / "stopped"), SMALL, jobs=1)
    assert sum(len(season.results_of(name)) for name in season.athletes()) == 7
    (tmp_path / "other").mkdir()
    make_synthetic(str(tmp_path / "other"), Synthetic(**{**vars(SMALL), "seed": 3}), jobs=1)
    for name in ("whole", "stopped"):
        update_tables(open_season(str(tmp_path / name)))
    whole, stopped = files(tmp_path / "whole"), files(tmp_path / "stopped")
    assert whole == stopped
    assert not set(files(tmp_path / "other")) & {name for name in whole if "/recordings/" in name}
    assert check(season) == []
    recording = load_recording(tmp_path / "whole" / recording_folder(who, season.recordings_of(who)[0]))
    assert recording.duration_s == pytest.approx(1.98)
    with pytest.raises(DataError, match="is a season of real recordings, or a synthetic one"):
        make_synthetic(str(tmp_path / "other"), SMALL, jobs=1)


def test_several_processes_make_the_same(tmp_path: Path) -> None:
    make_synthetic(str(tmp_path / "one"), Synthetic(25, 3, strokes=12), jobs=1)
    make_synthetic(str(tmp_path / "two"), Synthetic(25, 3, strokes=12), jobs=2)
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_a_crew_trains_together_and_the_year_is_filled() -> None:
    squad = synthetic_squad(1, 60)
    planned = plan(1, squad, 10_000)
    assert len({one.athlete.pseudonym for one in squad}) == 60
    sizes = [int(one.boat[0]) for one in squad]
    assert (sizes.count(1), sizes.count(2), sizes.count(4)) == (20, 20, 20)
    starts: dict[int, set[object]] = {}
    for one in planned:
        starts.setdefault(one.outing, set()).add((squad[one.member].boat, one.start))
    assert all(len(own) == 1 for own in starts.values())
    assert len({(one.start.year, one.start.month) for one in planned}) == 12
    assert 40 < sum(one.failed for one in planned) < 120
    assert not any(one.calibrated for one in planned)
    assert any(one.calibrated for one in plan(1, squad, 10_000, classes=2))
    two = [index for index, one in enumerate(squad) if one.boat == squad[-1].boat][:2]
    tables = [strokes(1, planned[index], squad[index], 50) for index in two]
    late = tables[0].columns["catch_time_s"] - tables[1].columns["catch_time_s"]
    assert abs(late.mean()) < 0.1
    assert late.std() < 0.03
    assert len(tables[0].stds) >= 10
