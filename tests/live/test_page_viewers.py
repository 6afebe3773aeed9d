"""Several viewers of the live page, names that are HTML, and targets whose colour and tone come with their stroke."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from page_session import PageSession
from page_tabs import opened, until
from senders import with_test_format

import oarlock
from headless_chromium import chromium

pytestmark = pytest.mark.long

NOT_TRIED = "THE LIVE PAGE WAS NOT TRIED IN A BROWSER"
VIEWERS = 10
EVIL = "<img src=x onerror=window.hacked=1><script>window.hacked=1</script>"
TONES = """
window.tones = [];
window.AudioContext = class {
  currentTime = 0;
  destination = {};
  resume() {}
  createGain() { return { gain: { setValueAtTime() {}, exponentialRampToValueAtTime() {} }, connect: (to) => to }; }
  createOscillator() {
    const frequency = { value: 0 };
    return { frequency, connect: (to) => to, start: () => tones.push(frequency.value), stop() {} };
  }
};
"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium(NOT_TRIED) as launched:
        yield launched


@pytest.fixture
def session(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    with PageSession(sculler, tmp_path / "today", 120.0, token="t0k&n") as running:
        yield running


def read_all(url, ended):
    """A program that reads as fast as it can, until it is told to end."""
    for _ in oarlock.live.frames(url):
        if ended.is_set():
            return


def test_among_ten_viewers_each_browser_has_its_own_curves(browser, session):
    ended = threading.Event()
    programs = [threading.Thread(target=read_all, args=(session.url, ended)) for _ in range(VIEWERS - 2)]
    for program in programs:
        program.start()
    with opened(browser, session) as one, opened(browser, session, (390, 844)) as other:
        until(one, "oarlock.live.health")
        assert session.call(lambda: len(session.server.viewers)) == VIEWERS
        for tab, wanted in ((one, "hand flexion, deg"), (other, "seat, mm")):
            tab.locator("summary", has_text="Choose curves").click()
            chosen = tab.locator(".ol-curves .ol-boxes input:checked")
            while chosen.count():
                chosen.first.uncheck()
            tab.get_by_label(wanted, exact=True).check()
        assert one.locator(".ol-chart b").all_inner_texts() == ["hand flexion"]
        assert other.locator(".ol-chart b").all_inner_texts() == ["seat"]
        session.stroke(1, arc=100.0)
        for tab in (one, other):
            before_s = tab.evaluate("() => oarlock.live.frame.time_s")
            until(tab, f"oarlock.live.frame.time_s > {before_s}")
            tab.locator(".ol-strokes tbody th", has_text="1").wait_for()
        ended.set()
    for program in programs:
        program.join(60)
        assert not program.is_alive()


def poisoned(told, key=""):
    """A message whose names and texts are HTML, but for the words that the page compares."""
    if isinstance(told, dict):
        return {name: poisoned(value, name) for name, value in told.items()}
    if isinstance(told, list):
        return [poisoned(value, key) for value in told]
    return (
        f"{EVIL}{told}"
        if key in ("name", "label", "panel", "hint", "title", "model", "text") and told
        else told
    )


def test_names_and_notes_that_are_html_are_shown_as_text(browser, sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    session = PageSession(sculler, tmp_path / "today", 120.0)
    plain, publish = session.server.hello, session.server.publish
    session.server.hello = lambda: poisoned(plain())
    session.server.publish = lambda told: publish(poisoned(told) if told["type"] == "health" else told)
    with session, opened(browser, session) as tab:
        session.call(
            lambda: session.server.announce(poisoned({"type": "event", "time_s": 1.0, "text": "odd"}))
        )
        session.stroke(1, arc=100.0)
        tab.keyboard.press("n")
        tab.keyboard.type(EVIL)
        tab.keyboard.press("Enter")
        until(tab, "oarlock.live.health")
        tab.locator(".ol-events").get_by_text(f"note: {EVIL}").wait_for()
        tab.locator(".ol-events").get_by_text(f"{EVIL}odd").wait_for()
        tab.evaluate("() => oarlock.live.link.send({do: '<img src=x onerror=window.hacked=1>'})")
        tab.get_by_role("alert").get_by_text("is unknown; expected").wait_for()
        for place in ("h1", ".ol-sensors tbody th", ".ol-chart b", ".ol-strokes th span", ".ol-boxes label"):
            assert EVIL in tab.locator(place).first.text_content(), place
        tab.locator("summary", has_text="Choose curves").click()
        tab.get_by_role("button", name="Names of the joints").click()
        tab.keyboard.press("b")
        until(tab, "document.querySelector('.ol-tile')")
        assert EVIL in tab.title()
        assert tab.evaluate("() => [window.hacked, document.images.length, document.scripts.length]") == [
            None,
            0,
            1,
        ]


def test_colour_and_tone_come_with_the_stroke_itself_not_with_the_next(browser, session):
    with opened(browser, session, script=TONES) as tab:
        tab.get_by_label("sound: high within all targets, low outside").check()
        tab.locator("summary", has_text="Set targets").click()
        tab.get_by_label("Arc, lowest target, deg").fill("95")
        tab.get_by_label("Arc, highest target, deg").fill("105")
        tab.get_by_label("Arc, highest target, deg").press("Tab")
        expected = []
        for number, arc in enumerate((100.0, 90.0, 110.0, 96.0), start=1):
            session.stroke(number, arc=arc)
            row = tab.locator(".ol-strokes tbody tr", has=tab.locator("th", has_text=str(number)))
            row.wait_for()
            is_within = 95 <= arc <= 105
            expected.append(880 if is_within else 220)
            assert tab.evaluate("() => tones") == expected, "one tone a stroke, at once"
            assert row.locator(".ol-within" if is_within else ".ol-outside").count() == 1
        session.stroke(4, arc=90.0)
        row.locator(".ol-outside").wait_for()
        assert tab.evaluate("() => tones") == expected, "a correction is seen and not heard"


def test_a_viewer_that_comes_late_hears_no_tones_of_strokes_that_were(browser, session):
    for number in range(1, 6):
        session.stroke(number, arc=100.0)
    with opened(browser, session, script=TONES) as tab:
        assert tab.locator(".ol-strokes tbody tr").count() == 5
        assert tab.evaluate("() => tones") == []
