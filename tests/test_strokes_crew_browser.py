"""The pages of an export and of a crew in headless Chromium: short on a telephone, no serious violation for axe."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from crew_pieces import crew_recordings
from headless_chromium import chromium, quiet_tabs, serious_violations
from oarlock.rowing import crew_seats, crew_timing, load_export, write_crew_report
from oarlock.rowing.report.export_page import write_strokes_report

pytestmark = pytest.mark.long

NOT_TRIED = "THE PAGES OF EXPORTS AND CREWS WERE NOT TRIED IN A BROWSER"
EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
EIGHT = ("bow", "2", "3", "4", "5", "6", "7", "stroke")
PHONE_PX = 6000
"""A page is no longer on a telephone before anything is unfolded."""
SIDEWAYS_PX = 1
"""The page itself never scrolls sideways; its tables may."""


def crew_page(folder: Path, seats: tuple[str, ...]) -> Path:
    late_s = [0.025, *[0.0] * (len(seats) - 1)]
    timing = crew_timing(crew_seats(crew_recordings(late_s), seats, source="oars"), clock_std_s=0.0)
    return write_crew_report(timing, folder / f"crew-{len(seats)}.html")[0]


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    exports = {
        name: write_strokes_report(
            load_export(EXAMPLES / f"{name}.csv"),
            folder / f"{name}.html",
            load_export(EXAMPLES / f"{name}.csv"),
            {"athlete": "A07", "date": "2026-05-01", "place": "Lake"},
        )
        for name in ("rp3", "speedcoach_empower")
    }
    return {
        **exports,
        "four": crew_page(folder, ("bow", "2", "3", "stroke")),
        "eight": crew_page(folder, EIGHT),
    }


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium(NOT_TRIED) as launched:
        yield launched


@pytest.mark.parametrize("name", ["rp3", "speedcoach_empower", "four", "eight"])
@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_a_page_is_short_and_axe_finds_no_serious_violation(browser, pages, name, width, scheme):
    with quiet_tabs(browser, ()) as opened:
        tab = opened(pages[name], width, color_scheme=scheme)
        assert tab.evaluate("document.documentElement.scrollHeight") < PHONE_PX
        assert tab.evaluate("document.documentElement.scrollWidth") <= width + SIDEWAYS_PX
        assert serious_violations(tab) == []


def test_how_it_was_measured_is_one_link_away(browser, pages):
    with quiet_tabs(browser, ()) as opened:
        for page in pages.values():
            tab = opened(page)
            folded = tab.locator("#measured-in")
            assert not folded.is_visible()
            tab.locator(".trust a").click()
            folded.wait_for(state="visible")
