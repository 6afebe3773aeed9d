"""A rower's report in headless Chromium, without a network: nothing complains, tables sort, figure and curves agree."""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oarlock
from headless_chromium import Opened, chromium, quiet_tabs, serious_violations
from oarlock.report import Point, Sourced, write_summary
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.report.write import rowing_front, write_rowing_report
from rowed_truth import rowed

pytestmark = pytest.mark.long

NOT_TRIED = "THE REPORT WAS NOT TRIED IN A BROWSER"
EXPECTED = ("GPU stall",)
"""Software WebGL says how slowly it reads pixels back."""
PIXEL_S = 0.06
"""A pixel of a panel is a hundredth of a second or three."""
PHONE_PX = 6000
"""A page is no longer on a telephone before anything is unfolded."""
SIDEWAYS_PX = 1
"""The page itself never scrolls sideways; its tables may."""


@pytest.fixture(scope="module")
def track() -> oarlock.Track:
    return rowed("S-NB", 16.0, 26.0, 1)


@pytest.fixture(scope="module")
def report(track: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("both") / "report.html"
    return write_rowing_report(track, file, other=rowed("S-NB", 12.0, 32.0, 2), names=("after", "before"))[0]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium(NOT_TRIED) as launched:
        yield launched


@pytest.fixture
def opened(browser: Any, report: Path) -> Iterator[Opened]:
    """Opens the report without a network; whatever the console says fails the test."""
    with quiet_tabs(browser, EXPECTED) as open_:
        yield partial(open_, report)


def unfold(tab: Any, section: str) -> None:
    tab.locator(f"nav a[href='#{section}-in']").click()
    tab.locator(f"#{section}-in").wait_for(state="visible")


def column(tab: Any, table: str, number: int) -> list[float]:
    cells = tab.locator(f"#{table} tbody tr > :nth-child({number}) data")
    return [float(cell.get_attribute("value")) for cell in cells.all()]


def test_a_click_and_a_key_sort_the_strokes(opened, track):
    tab = opened()
    unfold(tab, "strokes")
    head = tab.locator("#strokes-table thead th").nth(2)
    count = len(technique(track).strokes)
    before = column(tab, "strokes-table", 1)
    assert before == [k + 1.0 for k in range(count)]
    head.locator("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    known = [value for value in column(tab, "strokes-table", 3) if np.isfinite(value)]
    assert known == sorted(known)
    assert np.isnan(column(tab, "strokes-table", 3)[len(known) :]).all()
    head.locator("button").focus()
    tab.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    known = [value for value in column(tab, "strokes-table", 3) if np.isfinite(value)]
    assert known == sorted(known, reverse=True)
    assert np.isnan(column(tab, "strokes-table", 3)[len(known) :]).all()
    tab.locator("#strokes-table thead th button").first.click()
    assert column(tab, "strokes-table", 1) == before
    assert tab.locator("#strokes-table [aria-sort]").count() == 1


def test_a_strokes_number_repeats_it_and_figure_and_curves_go_together(opened, track):
    tab = opened()
    tab.wait_for_function("window.oarlock.players.length == 1")
    unfold(tab, "strokes")
    tab.locator('#strokes-table a[data-stroke="stroke 3"]').click()
    start_s = float(technique(track).strokes["catch_time_s"][2])
    assert tab.evaluate("oarlock.players[0].time_s") == pytest.approx(start_s, abs=PIXEL_S)
    assert tab.evaluate("oarlock.players[0].clock.loop.label") == "stroke 3"
    where = tab.evaluate("oarlock.players[0].jointPosition('r_handle')")
    row = int(np.argmin(np.abs(track.time_s - start_s)))
    assert where == pytest.approx(list(track.frame_positions("r_handle")[row]), abs=0.02)
    tab.evaluate(f"oarlock.players[0].seek({start_s + 0.8})")
    # The cursors are drawn with the next frame, which a busy machine takes its time for.
    tab.wait_for_function(
        "([at_s, off_s]) => oarlock.players[0].headTimes_s.every(t => Math.abs(t - at_s) < off_s)",
        arg=[start_s + 0.8, PIXEL_S],
    )
    heads = tab.evaluate("oarlock.players[0].headTimes_s")
    assert heads
    assert heads == pytest.approx([start_s + 0.8] * len(heads), abs=PIXEL_S)


def test_the_players_curves_have_the_names_and_units_of_the_tables(opened):
    tab = opened()
    tab.wait_for_function("window.oarlock.players.length == 1")
    panels = tab.evaluate("oarlock.players[0].scene.panels.map(p => [p.label, p.unit, p.open])")
    assert panels[:2] == [["oar angle", "deg", True], ["seat", "cm", True]]


def test_the_second_piece_is_the_ghost(opened):
    tab = opened()
    tab.wait_for_function("window.oarlock.players.length == 1")
    assert tab.evaluate("oarlock.players[0].ghost.span.label").startswith("stroke ")
    tab.evaluate("oarlock.players[0].seek(3.0)")
    assert tab.evaluate("oarlock.players[0].ghostPosition('r_handle') !== null")
    tab.evaluate("oarlock.players[0].setGhost('other')")
    assert tab.evaluate("oarlock.players[0].ghostPosition('r_handle') !== null")


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_never_scrolls_sideways(opened, width):
    tab = opened(width)
    assert tab.evaluate("document.documentElement.scrollWidth") <= width + SIDEWAYS_PX


@pytest.mark.parametrize("scripts", [True, False])
def test_a_name_leads_to_its_meaning_which_is_folded_away_until_then(opened, scripts):
    tab = opened(java_script_enabled=scripts)
    folded = tab.locator("#meanings > details")
    assert folded.get_attribute("open") is None
    tab.locator("nav a[href='#numbers-in']").click()
    name = tab.locator("#numbers a.term").first
    meaning = tab.locator(f"#defined-table tr:has([id='{name.get_attribute('href')[1:]}'])")
    assert not meaning.is_visible()
    name.click()
    meaning.wait_for(state="visible")
    assert folded.get_attribute("open") is not None


def test_what_is_folded_is_printed_all_the_same(opened):
    tab = opened()
    tab.emulate_media(media="print")
    assert tab.locator("#defined-table").bounding_box()["height"] > 1000
    assert tab.locator("#curves figure").first.is_visible()


def test_without_script_the_tables_are_all_there(opened, track):
    tab = opened(java_script_enabled=False)
    assert tab.locator("#strokes-table tbody tr").count() == len(technique(track).strokes)
    assert tab.locator("#strokes-table thead button").count() == 0
    assert tab.locator("#compared-pieces-table tbody tr").count() > 10


def test_the_page_is_short_on_a_telephone_until_it_is_unfolded(opened):
    tab = opened(390)
    assert tab.evaluate("document.documentElement.scrollHeight") < PHONE_PX
    tab.locator("#compared-pieces summary").click()
    wide = "e => { const box = e.parentElement; return box.scrollWidth - box.clientWidth; }"
    assert tab.locator("#compared-pieces-table").evaluate(wide) <= SIDEWAYS_PX


def test_a_key_figure_says_what_it_means_when_pressed(browser, track, tmp_path):
    with quiet_tabs(browser, EXPECTED) as open_:
        press_a_key_figure(
            open_(write_rowing_report(track, tmp_path / "one.html")[0], 390, java_script_enabled=False)
        )


def press_a_key_figure(tab):
    name = tab.locator(".figures button.say").first
    meaning = tab.locator(f"[id='{name.get_attribute('popovertarget')}']")
    assert not meaning.is_visible()
    name.focus()
    tab.keyboard.press("Enter")
    meaning.wait_for(state="visible")
    tab.keyboard.press("Escape")
    meaning.wait_for(state="hidden")


def test_how_it_was_measured_is_folded_and_one_link_away(opened):
    tab = opened()
    assert not tab.locator("#notes").is_visible()
    tab.locator(".trust a").click()
    tab.locator("#notes").wait_for(state="visible")


@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (390, "light")])
def test_axe_finds_no_serious_violation(opened, width, scheme):
    assert serious_violations(opened(width, color_scheme=scheme)) == []


def test_the_sheet_is_one_page_of_a4(browser, track, tmp_path):
    long = [Sourced("Why. " * 20, "A 2020")] * 3
    point = Point("Right and left", "The right hand is late. " * 4, "+30 ± 6 ms", *long)
    title, front = rowing_front(track)
    for name, points in (("own", front.points), ("full", [point] * 5)):
        sheet = write_summary(track, tmp_path / f"{name}.html", title, replace(front, points=points))
        with quiet_tabs(browser, EXPECTED) as open_:
            tab = open_(sheet)
            pdf = tab.pdf(prefer_css_page_size=True, print_background=True)
            foot, sheet_box = (tab.locator(part).bounding_box() for part in ("footer", "main"))
            assert foot["y"] + foot["height"] <= sheet_box["y"] + sheet_box["height"]
        assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1
