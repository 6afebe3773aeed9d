"""The page of a season: offline, small, planted changes listed, unchanged athletes left out, mixed classes said."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from command_line import run
from headless_chromium import chromium, quiet_tabs, serious_violations
from html_page import Page, assert_loads_nothing, assert_references_lead_somewhere
from oarlock import DataError
from oarlock.season import Database, Selection, write_season_page
from oarlock.season.page import against_band, beyond_chance, gathered
from oarlock_lab.synthetic_season import Synthetic
from season_answers import answered, ask_of

WHAT = Synthetic(12 * 40, 12, seed=12, strokes=40)
NOT_TRIED = "THE SEASON PAGE WAS NOT TRIED IN A BROWSER"
METRICS = ("catch_angle", "catch_factor", "seat_travel")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Season, tables, squad and its page: 12 athletes, 40 sessions each."""
    folder = tmp_path_factory.mktemp("season")
    season, current, squad = answered(folder / "season", WHAT)
    with pytest.MonkeyPatch.context() as patch:
        ask_of(patch, current)
        file = write_season_page(season, folder, METRICS)
    return season, current, squad, file


def test_the_page_loads_nothing_and_is_small(made) -> None:
    text = made[3].read_text(encoding="utf-8")
    page = Page(text)
    assert_loads_nothing(page)
    assert_references_lead_somewhere(page)
    assert "default-src 'none'" in text
    assert not any("src" in script for script in page.all("script"))
    # 60 athletes with six metrics have 10 times as many charts; the page of these is to stay under 3 MB
    assert len(text.encode()) < 0.3e6
    assert "12 athletes rowed 480 sessions" in page.text


def test_planted_changes_are_listed_and_nobody_else(made) -> None:
    season, current, squad, _ = made
    with Database(season, tables=current) as database:
        found = gathered(database, METRICS)
    listed = {(row["athlete"], row["metric"]) for row in found.changes}
    for one in squad:
        for metric in found.metrics:
            if one.drift.get(metric):
                assert (one.athlete.pseudonym, metric) in listed
            elif not one.rig_step.get(metric):
                assert (one.athlete.pseudonym, metric) not in listed
    sizes = [against_band(row) for row in found.changes]
    assert sizes == sorted(sizes, reverse=True)
    assert min(sizes) > 1.0


def test_the_number_of_comparisons_counts() -> None:
    def one(chance: float) -> dict[str, Any]:
        return {"athlete": "A", "metric": "m", "change": 1.0, "low": 0.5, "high": 1.5, "chance": chance}

    assert beyond_chance([]) == []
    assert len(beyond_chance([one(0.04)])) == 1
    assert beyond_chance([one(0.04), *(one(0.5) for _ in range(9))]) == []
    # 0.05 * k / 4: 0.0125, 0.025, 0.0375; the third takes the second along, which is above its own limit
    assert len(beyond_chance([one(0.001), one(0.03), one(0.035), one(0.9)])) == 3


def test_mixed_classes_are_said_and_kept_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    season, current, squad = answered(tmp_path, Synthetic(96, 2, seed=5, classes=2, strokes=30))
    ask_of(monkeypatch, current)
    with Database(season) as database:
        found = gathered(database, ["catch_angle"])
        other = found.classes[1]["comparable"]
        assert gathered(database, ["catch_angle"], other).comparable == other
    assert all(row["comparable"] == found.comparable for rows in found.trends.values() for row in rows)
    text = Page(write_season_page(season, tmp_path / "page.html", ["catch_angle"]).read_text("utf-8")).text
    assert "Results of 2 classes" in text
    assert "must not be compared" in text
    with pytest.raises(DataError, match="no class of runs"):
        write_season_page(season, tmp_path / "page.html", comparable="none")
    name, others = squad[0].athlete.pseudonym, squad[1].athlete.pseudonym
    alone = write_season_page(season, tmp_path / "one.html", selection=Selection(name)).read_text("utf-8")
    assert name in alone
    assert others not in alone


def test_the_command(tmp_path: Path) -> None:
    at, out = tmp_path / "season", tmp_path / "page.html"
    run("lab", "season", at, "--recordings", 10, "--athletes", 2, "--jobs", 1, "--seed", 4)
    told = run("season", "page", at, "--out", out, "--metric", "catch_angle", "--scope", "coaching").stdout
    assert "Wrote" in told
    assert "What changed" in out.read_text("utf-8")
    assert "page.html" in run("season", "page", at, "--out", out, status=2).stderr


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium(NOT_TRIED) as launched:
        yield launched


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_in_a_browser(made, browser, width: int, scheme: str) -> None:
    with quiet_tabs(browser, ()) as open_:
        tab = open_(made[3], width, color_scheme=scheme)
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        assert tab.evaluate("document.documentElement.scrollHeight") < 6000
        assert serious_violations(tab) == []
        head = tab.locator("#heat-table thead th:nth-child(3) button")
        head.focus()
        tab.keyboard.press("Enter")
        assert head.locator("xpath=..").get_attribute("aria-sort") is not None
