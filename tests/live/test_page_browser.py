"""The live page in headless Chromium: the figure follows the session, nothing complains or comes from elsewhere."""

import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from page_session import PageSession
from page_tabs import opened, until
from senders import with_test_format

from headless_chromium import chromium
from oarlock.live.folder import LiveFolder
from oarlock.live.session import COMMANDS

pytestmark = pytest.mark.long

NOT_TRIED = "THE LIVE PAGE WAS NOT TRIED IN A BROWSER"
SECONDS = 60.0
SIZES = [(1280, 860), (390, 844)]
LEAST_CONTRAST = 4.5
"""WCAG 2.2, level AA, of text of any size."""
PLACE_M = 2e-3
"""Places are whole millimetres; angles have five decimals."""
STALL_S = 2.0

CONTRASTS = """() => {
  const channel = v => (v /= 255) <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
  const light = c => .2126 * channel(c[0]) + .7152 * channel(c[1]) + .0722 * channel(c[2]);
  const rgba = text => { const v = text.match(/[\\d.]+/g).map(Number); return v.length < 4 ? [...v, 1] : v; };
  const ground = e => {
    for (; e; e = e.parentElement) {
      const colour = rgba(getComputedStyle(e).backgroundColor);
      if (colour[3] === 1) return colour;
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const e of document.querySelectorAll('body *')) {
    const own = [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility() || e.closest('[disabled], noscript, script, option')) continue;
    const [a, b] = [light(rgba(getComputedStyle(e).color)), light(ground(e))].sort((x, y) => y - x);
    found.push([(a + .05) / (b + .05), e.className + ': ' + e.textContent.slice(0, 40)]);
  }
  return found;
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium(NOT_TRIED) as launched:
        yield launched


@pytest.fixture
def session(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    with PageSession(sculler, tmp_path / "today", SECONDS, token="t0k&n") as running:
        yield running


def test_the_figure_is_where_the_joints_say_and_moves(browser, session, sculler):
    with opened(browser, session) as tab:
        places = []
        for _ in range(5):
            frame, hand = tab.evaluate("() => [oarlock.live.frame, oarlock.live.jointPosition('r_hand')]")
            q = np.array([frame["joints"].get(name, [0.0])[0] for name in sculler.coordinate_names])
            pose = np.asarray(sculler.forward_kinematics(q[None]))[0][sculler.frame_names.index("r_hand")]
            np.testing.assert_allclose(hand, pose[:3, 3], rtol=0, atol=PLACE_M)
            places.append(hand)
            until(tab, f"oarlock.live.frame.time_s > {frame['time_s'] + 0.2}")
        assert np.ptp(places, axis=0).max() > 0.1
        picture = tab.locator(".ol-picture").screenshot()
        until(tab, f"oarlock.live.frame.time_s > {frame['time_s'] + 1.0}")
        assert tab.locator(".ol-picture").screenshot() != picture
        assert tab.get_by_text("Tracking", exact=True).is_visible()


def test_every_frame_is_acknowledged_after_it_was_painted(browser, session):
    with opened(browser, session) as tab:
        painted = until(tab, "oarlock.live.painted.length > 30 && oarlock.live.painted")
        assert np.all(np.diff([one["time_s"] for one in painted]) > 0)
        assert all(0.0 <= one["waited_ms"] <= one["age_ms"] + 1.0 for one in painted)
        assert re.fullmatch(r"figure \d+ (ms|s) old", tab.locator(".ol-age").inner_text())


def test_a_page_that_stalls_shows_the_newest_frame_next(browser, session):
    with opened(browser, session) as tab:
        before = tab.evaluate("() => [oarlock.live.frames, oarlock.live.frame.time_s, oarlock.live.skipped]")
        stall = f"const end = performance.now() + {1e3 * STALL_S}; while (performance.now() < end);"
        tab.evaluate(f"() => {{ {stall} }}")
        until(tab, f"oarlock.live.frame.time_s > {before[1] + 0.9 * STALL_S}")
        after = tab.evaluate("() => [oarlock.live.frames, oarlock.live.frame.time_s, oarlock.live.skipped]")
        assert after[2] > before[2] + 20
        assert after[1] - before[1] > 0.01 * 3 * (after[0] - before[0]), "it did not work through old frames"


def test_a_silent_sensor_stands_out_and_another_unit_takes_its_place(browser, session):
    with opened(browser, session) as tab:
        session.silenced.add("back")
        alarm = tab.get_by_role("alert")
        alarm.get_by_text("Silent: back.").wait_for()
        row = tab.locator("tr.ol-bad", has_text="back")
        assert "silent for" in row.inner_text()
        session.spare()
        tab.locator("tr.ol-spare", has_text="spare-7").wait_for()
        row.get_by_role("button", name="Exchange the unit of back").click()
        assert tab.get_by_label("Sensor", exact=True).input_value() == "back"
        spare = tab.get_by_label("is now unit").locator("option", has_text="spare-7").get_attribute("value")
        tab.get_by_label("is now unit").select_option(spare)
        tab.get_by_role("button", name="Use this unit").press("Enter")
        tab.locator(".ol-events").get_by_text(f"{spare} feeds back from now on").wait_for()
        session.silenced.clear()
        tab.locator("tr.ol-spare", has_text="/back").wait_for()


SHOWN = {
    "speed": "4.21 m/s",
    "heart rate": "152 /min",
    "pace": "1:58.8 /500 m",
    "latitude": "48.117302°",
    "stroke state": "<i>Drive",
}


def test_what_feeds_no_sensor_is_shown_with_its_unit(browser, session):
    values = {"speed_m_s": 4.2125, "heart_rate_per_min": 152.0, "pace_s_per_500_m": 118.84}
    values |= {"latitude_deg": 48.117302, "stroke_state": "<i>Drive"}
    with opened(browser, session) as tab:
        assert not tab.locator(".ol-channels").is_visible()
        session.also("erg-3", **values, handle_force_n=(1.0, 2.0))
        group = tab.locator(".ol-channels > div", has_text="radio/erg-3")
        group.wait_for()
        rows = [row.split("\n") for row in group.locator("dl > div").all_inner_texts()]
        assert dict(rows) == SHOWN
        tab.locator("tr.ol-spare", has_text="recorded, feeds no sensor").wait_for()
        session.also("erg-3", speed_m_s=-0.004)
        group.get_by_text("0.00 m/s").wait_for()
        group.get_by_text("silent for").wait_for()


def test_a_note_by_keyboard_is_in_the_recording(browser, session, tmp_path):
    with opened(browser, session) as tab:
        tab.keyboard.press("n")
        asked_s = tab.evaluate("() => oarlock.live.log.asked_s")
        tab.keyboard.type("seat squeaks <b>")
        tab.keyboard.press("Enter")
        tab.locator(".ol-events").get_by_text("note: seat squeaks <b>").wait_for()
    session.end()
    orders = [json.loads(p.data) for p in LiveFolder.load(tmp_path / "today").read() if p.source == COMMANDS]
    (note,) = (order for order in orders if order["do"] == "note")
    assert note["text"] == "seat squeaks <b>" and note["time_s"] == pytest.approx(asked_s, abs=0.01)


def test_tracking_stops_at_the_second_press_and_starts_by_key(browser, session):
    with opened(browser, session) as tab:
        tab.get_by_role("button", name="Stop tracking").click()
        assert tab.evaluate("() => oarlock.live.health.is_tracking")
        tab.get_by_role("button", name="Press again to stop").click()
        until(tab, "!oarlock.live.health.is_tracking")
        tab.get_by_role("button", name="Start tracking").wait_for()
        tab.keyboard.press("t")
        until(tab, "oarlock.live.health.is_tracking")


def test_strokes_are_judged_by_targets_that_the_browser_remembers(browser, session):
    with opened(browser, session) as tab:
        session.stroke(1, arc=100.0, catch=-62.0)
        session.stroke(2, arc=90.0, catch=-55.0)
        tab.locator("summary", has_text="Set targets").click()
        tab.get_by_label("Arc, lowest target, deg").fill("95")
        tab.get_by_label("Catch, highest target, deg").fill("-50")
        tab.get_by_label("Catch, highest target, deg").press("Tab")
        for _ in range(2):
            rows = tab.locator(".ol-strokes tbody tr")
            assert rows.locator("th").all_inner_texts() == ["2", "1"]
            assert "90.0" in rows.first.locator(".ol-outside").inner_text()
            assert "low" in rows.first.locator(".ol-outside").inner_text()
            assert rows.first.locator(".ol-within").inner_text().startswith("−55.0")
            assert rows.nth(1).locator(".ol-within").count() == 2
            assert "best" in rows.nth(1).inner_text()
            tab.reload()
            until(tab, "(oarlock.live?.frames ?? 0) > 3")


def test_chosen_curves_and_their_span_are_remembered_and_shown_large(browser, session):
    with opened(browser, session) as tab:
        tab.locator("summary", has_text="Choose curves").click()
        tab.get_by_label("trunk, deg").uncheck()
        tab.get_by_label("hand flexion, deg").check()
        tab.get_by_label("last", exact=True).select_option("30")
        tab.reload()
        until(tab, "(oarlock.live?.frames ?? 0) > 3")
        shown = tab.locator(".ol-chart b").all_inner_texts()
        assert "hand flexion" in shown and "trunk" not in shown
        assert tab.get_by_label("last", exact=True).input_value() == "30"
        tab.keyboard.press("b")
        tile = tab.locator(".ol-tile", has_text="left hand flexion").locator("b")
        assert re.fullmatch(r"−?\d+°", tile.inner_text())
        assert tile.bounding_box()["height"] > 60
        tab.keyboard.press("Escape")
        assert tab.locator(".ol-chart").first.is_visible()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_nothing_sticks_out_all_has_a_name_and_can_be_read(browser, session, size, scheme):
    with opened(browser, session, size, color_scheme=scheme) as tab:
        session.stroke(1, arc=100.0, catch=-62.0, rate=24.0, drive=0.9)
        session.silenced.add("seat")
        tab.get_by_role("alert").get_by_text("seat").wait_for()
        for _ in range(2):
            assert tab.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
            outside = tab.evaluate(
                """() => [...document.querySelectorAll('.ol-card, .ol-card table, .ol-tile b')]
                    .filter(e => e.checkVisibility() && !e.closest('.ol-scroll') && e.getBoundingClientRect().right
                        > e.parentElement.getBoundingClientRect().right + 1).map(e => e.outerHTML.slice(0, 200))"""
            )
            assert outside == []
            faint = [one for one in tab.evaluate(CONTRASTS) if one[0] < LEAST_CONTRAST]
            assert faint == []
            nameless = tab.evaluate(
                """() => [...document.querySelectorAll('button, input, select, canvas')]
                    .filter(e => !e.getAttribute('aria-label') && !e.textContent.trim())
                    .filter(e => !(e.labels && e.labels.length)).map(e => e.outerHTML)"""
            )
            assert nameless == []
            tab.keyboard.press("b")


def test_a_lost_connection_is_said_and_found_again(browser, session, sculler, tmp_path):
    failed = ("WebSocket connection to",)
    with opened(browser, session, expected=failed) as tab:
        session.end()
        tab.get_by_text("No connection to the session").wait_for()
        assert tab.locator(".ol-chip").inner_text() == "No connection"
        until(tab, "document.querySelector('.ol-page').classList.contains('ol-stale')")
        # "Stop tracking", or "Start tracking" if the end of it was heard before the connection was lost
        assert tab.locator(".ol-actions .ol-main").is_disabled()
        port = session.server.port
        with PageSession(sculler, tmp_path / "again", SECONDS, port=port, token="t0k&n"):
            until(tab, "oarlock.live.link.state === 'open' && oarlock.live.frame")
            until(tab, "!document.querySelector('.ol-page').classList.contains('ol-stale')")
            assert not tab.get_by_text("No connection to the session").is_visible()
