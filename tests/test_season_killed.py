"""Writers of a season that are killed at 30 moments, and an erasure beside two of them, leave it in order."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import season_support as support
from oarlock.season import create_season, season_summary
from oarlock.season.erase import erase
from oarlock.season.tables import update_tables
from oarlock.season.upkeep import check

pytestmark = pytest.mark.long


def test_thirty_kills(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    rng = np.random.default_rng(24)
    for round_ in range(30):
        with support.writer(tmp_path / "season", 1000 * round_, "add result tables", tmp_path) as one:
            support.wait_for(one, int(rng.integers(0, 3)))
            time.sleep(rng.uniform(0.0, 0.3))
        assert {found.what for found in check(season)} <= {"unfinished"}, round_
    update_tables(season)
    counts = season_summary(season).counts
    assert counts["recordings"] >= 10
    assert counts["failed"] == 0
    assert counts["strokes"] == 5 * counts["with results"]


def test_an_erasure_beside_two_writers_and_an_update_of_tables(season_address: str, tmp_path: Path) -> None:
    if season_address.startswith("memory"):
        pytest.skip("no other process sees this memory")
    season = create_season(season_address, "club")
    for round_, gone in enumerate(("K7QMVA", "R9TWXB", "Z3HJKP")):
        support.squad(season, gone)
        first = 1000 * round_
        with (
            support.writer(season_address, first, "add result", tmp_path, gone) as one,
            support.writer(season_address, first + 500, "add result", tmp_path, gone) as two,
            support.writer(season_address, 0, "tables", tmp_path) as three,
        ):
            for process in (one, two, three):
                support.wait_for(process, 4)
            found = erase(season, gone, dry_run=False)
            for process in (one, two):
                # Its next recording is refused, whatever it was doing.
                said = process.communicate()[1]
                assert "was erased from this season meanwhile" in said or "is not a pseudonym" in said
            support.wait_for(three, 2)
        assert found.removed["recordings"] >= 6
        assert {one.what for one in check(season)} <= {"unfinished"}
        assert list(season.place.files(f"athlete={gone}")) == []
        assert gone not in season.folders()
    assert season.recordings() == {}


@pytest.mark.parametrize("rounds", [3])
def test_two_adds_and_an_update_of_tables_at_once(
    season_address: str, tmp_path: Path, rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if season_address.startswith("memory"):
        pytest.skip("no other process sees this memory")
    season = create_season(season_address, "club")
    support.squad(season, "AAAAAA")
    for round_ in range(rounds):
        first = 1000 * round_
        with (
            support.writer(season_address, first, "add result", tmp_path) as one,
            support.writer(season_address, first, "add result", tmp_path) as two,
            support.writer(season_address, first, "tables", tmp_path) as three,
        ):
            for process in (one, two, three):
                support.wait_for(process, 10)
        assert {found.what for found in check(season)} <= {"unfinished"}
    update_tables(season)
    counts = season_summary(season).counts
    assert counts["recordings"] >= 10 * rounds
    assert counts["strokes"] == 5 * counts["with results"]
