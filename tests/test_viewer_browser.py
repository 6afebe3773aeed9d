"""The player in headless Chromium: figure, slider and curves show one time, and nothing complains."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oarlock
from headless_chromium import CHROMIUM, HANGS_MS, SOFTWARE, Opened, driver_of_chromium, quiet_tabs
from oarlock.report.viewer import embed, page, player_assets, scene
from oarlock.rowing import find_strokes, rowing_look, stroke_marks
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.simulation import Motion

pytestmark = pytest.mark.long

NOT_TRIED = "THE PLAYER WAS NOT TRIED IN A BROWSER"
NO_WEBGL = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"]
PLACE_M = 1e-4
"""Places are int16 steps of what moves a metre, and single precision in the page."""
PIXEL_S = 0.06
"""A pixel of a panel is a hundredth of a second or three; the line is read back from where it was drawn."""
WIDTHS = [(1280, 900), (390, 844)]
EXPECTED = ("GPU stall", "Context Lost")
"""Software WebGL says how slowly it reads pixels back; three.js says what a test does to it."""
SPANS = [(1.0, 2.5, "one"), (2.5, 4.5, "two"), (4.5, 5.5, "three")]


@pytest.fixture(scope="module")
def driver() -> Iterator[Any]:
    with driver_of_chromium(NOT_TRIED) as found:
        yield found


@pytest.fixture(scope="module")
def browser(driver: Any) -> Iterator[Any]:
    launched = driver.launch(executable_path=CHROMIUM, args=SOFTWARE, timeout=HANGS_MS)
    yield launched
    launched.close()


@pytest.fixture
def opened(browser: Any) -> Iterator[Opened]:
    """Opens a file without a network; whatever the console says fails the test."""
    with quiet_tabs(browser, EXPECTED) as open_:

        def open_player(file: Path, *size: int, **settings: Any) -> Any:
            tab = open_(file, *size, **settings)
            tab.wait_for_function("window.oarlock.players.length > 0")
            return tab

        yield open_player


def swung(size_rad: float, rates: tuple[float, float], seed: int) -> oarlock.Track:
    """An arm that swings for six seconds; each joint is faster than the one before."""
    model = oarlock.load_model("arm7")
    time_s = np.linspace(0.0, 6.0, 601)
    swing = [size_rad * np.sin((rates[0] + rates[1] * k) * time_s) for k in range(len(model.joint_names))]
    motion = Motion(tuple(model.joint_names), time_s, np.stack(swing, axis=1))
    return oarlock.track(model, oarlock.simulate(model, motion, seed=seed)[1])


@pytest.fixture(scope="module")
def arm() -> oarlock.Track:
    return oarlock.smooth(swung(0.4, (1.0, 0.3), 0))


@pytest.fixture(scope="module")
def slow() -> oarlock.Track:
    return swung(0.3, (0.8, 0.2), 5)


@pytest.fixture(scope="module")
def arm_page(arm: oarlock.Track, slow: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("arm") / "arm.html"
    file.write_text(page(scene(arm, marks=SPANS, ghost=slow), "arm"), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def rower() -> oarlock.Track:
    return simulate_sculling(oarlock.load_model("sculler"), "B-B", 10.0, seed=2)[0]


@pytest.fixture(scope="module")
def rower_page(rower: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("rower") / "rower.html"
    drawn = scene(rower, marks=stroke_marks(find_strokes(rower)), look=rowing_look(rower))
    file.write_text(page(drawn, "rower"), encoding="utf-8")
    return file


def settle(tab: Any) -> None:
    """Wait for the next two frames."""
    tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def player(tab: Any, code: str) -> Any:
    """What an expression of the first player gives, once settled."""
    settle(tab)
    return tab.evaluate(f"() => {{ const p = oarlock.players[0]; return ({code}); }}")


def assert_there(tab: Any, track: oarlock.Track, frame: str, time_s: float, figure: str = "joint") -> None:
    """The figure (or the `ghost`) has the frame where the track has it; between samples the page goes straight."""
    places = track.frame_positions(frame)
    expected = [np.interp(time_s, track.time_s, places[:, k]) for k in range(3)]
    found = player(tab, f"p.{figure}Position('{frame}')")
    np.testing.assert_allclose(found, expected, rtol=0, atol=10 * PLACE_M)


@pytest.mark.parametrize("size", WIDTHS)
def test_slider_figure_and_curves_move_together(opened, arm_page, arm, size):
    tab = opened(arm_page, *size)
    slider = tab.get_by_role("slider", name="Time")
    for asked in (0.6, 3.21, 5.9):
        slider.fill(str(asked))
        settle(tab)
        time_s = player(tab, "p.time_s")
        assert time_s == pytest.approx(asked, abs=1e-9)
        assert_there(tab, arm, "hand", asked)
        heads = player(tab, "p.headTimes_s")
        assert len(heads) == 4 and heads == pytest.approx([asked] * 4, abs=PIXEL_S)
        assert f"{asked:.2f} s" in slider.get_attribute("aria-valuetext")


def test_at_a_shown_sample_the_place_is_the_tracks(opened, arm_page, arm):
    tab = opened(arm_page)
    for time_s in player(tab, "[p.figure.time_s[3], p.figure.time_s[100]]"):
        player(tab, f"p.seek({time_s!r})")
        row = int(np.argmin(np.abs(arm.time_s - time_s)))
        for frame in arm.model.frame_names:
            found = player(tab, f"p.jointPosition('{frame}')")
            np.testing.assert_allclose(found, arm.frame_positions(frame)[row], rtol=0, atol=PLACE_M)


def test_a_click_in_a_curve_moves_the_figure(opened, arm_page, arm):
    tab = opened(arm_page)
    plot = tab.locator(".op-panel:not([hidden]) .u-over").nth(1)
    box = plot.bounding_box()
    tab.mouse.click(box["x"] + 0.7 * box["width"], box["y"] + 20)
    settle(tab)
    time_s = player(tab, "p.time_s")
    assert time_s == pytest.approx(0.7 * 6.0, abs=2 * PIXEL_S)
    assert player(tab, "p.headTimes_s") == pytest.approx([time_s] * 4, abs=PIXEL_S)
    assert_there(tab, arm, "wrist", time_s)
    assert float(tab.get_by_role("slider", name="Time").input_value()) == pytest.approx(time_s, abs=1e-3)


def test_the_picture_changes_with_time_and_view(opened, rower_page):
    tab = opened(rower_page)
    stage = tab.locator(".op-stage")
    assert player(tab, "p.flat") is False, "software WebGL draws"
    pictures = []
    for time_s, view in ((1.0, "side"), (1.6, "side"), (1.6, "stern"), (1.6, "above")):
        player(tab, f"p.seek({time_s})")
        tab.get_by_role("button", name=f"Seen from: {view}").click()
        settle(tab)
        pictures.append(stage.screenshot())
    assert len(set(pictures)) == 4
    tab.locator("canvas").first.press("1")
    assert player(tab, "p.viewpoint") == "side"


def test_a_view_from_the_side_looks_along_the_bodys_side(opened, rower_page):
    tab = opened(rower_page)
    for key, axis in (("1", [-1, 0.16, 0]), ("2", [0, 0.22, 1]), ("3", [0, 1, 0])):
        tab.locator("canvas").first.press(key)
        back = player(tab, "p.camera.axes().back")
        np.testing.assert_allclose(back, np.array(axis) / np.linalg.norm(axis), rtol=0, atol=0.01)


def test_keys_step_turn_and_play(opened, arm_page):
    tab = opened(arm_page)
    canvas = tab.locator("canvas").first
    step = player(tab, "p.figure.time_s[1] - p.figure.time_s[0]")
    start = player(tab, "p.time_s")
    for _ in range(3):
        canvas.press("ArrowRight")
    canvas.press("ArrowLeft")
    assert player(tab, "p.time_s") == pytest.approx(start + 2 * step, abs=step / 2)
    before = player(tab, "p.camera.azimuth")
    canvas.press("Shift+ArrowRight")
    assert player(tab, "p.camera.azimuth") > before
    canvas.press("End")
    assert player(tab, "p.time_s") == player(tab, "p.figure.end_s")
    canvas.press("Home")
    canvas.press(" ")
    tab.wait_for_function("() => oarlock.players[0].time_s > oarlock.players[0].figure.start_s + 0.2")
    canvas.press(" ")
    assert player(tab, "p.clock.playing") is False
    tab.get_by_role("button", name="Play").click()
    assert player(tab, "p.clock.playing") is True


def test_a_loop_turns_back_and_the_curves_show_it(opened, arm_page):
    tab = opened(arm_page)
    tab.get_by_label("Loop").select_option(label="two")
    assert player(tab, "p.time_s") == pytest.approx(2.5)
    assert player(tab, "p.panels[0].uplot.scales.x.min") == pytest.approx(2.5)
    assert player(tab, "p.panels[0].uplot.scales.x.max") == pytest.approx(4.5)
    player(tab, "p.seek(4.4)")
    # 0.3 s on: 0.2 s after the loop's begin
    assert player(tab, "(p.clock.advance(0.3), p.time_s)") == pytest.approx(2.7)
    tab.get_by_label("Speed").select_option("4")
    tab.get_by_role("button", name="Play").click()
    tab.wait_for_timeout(700)
    assert 2.5 <= player(tab, "p.time_s") <= 4.5
    tab.get_by_label("Loop").select_option(label="whole")
    player(tab, "p.clock.pause()")
    player(tab, "p.seek(1.0)")
    tab.locator("canvas").first.press("[")
    player(tab, "p.seek(1.4)")
    tab.locator("canvas").first.press("]")
    loop = player(tab, "[p.clock.loop.start_s, p.clock.loop.end_s]")
    assert loop == pytest.approx([1.0, 1.4])


def test_a_ghost_of_another_span_by_phase_and_by_time(opened, arm_page, arm):
    tab = opened(arm_page)
    tab.get_by_label("Ghost").select_option(label="two")
    player(tab, "p.seek(1.75)")  # the middle of span one, 0.75 s into it
    by_phase = player(tab, "p.ghost_s")
    assert by_phase == pytest.approx(3.5)
    assert_there(tab, arm, "hand", 3.5, "ghost")
    tab.get_by_label("aligned by").select_option("time")
    assert player(tab, "p.ghost_s") == pytest.approx(3.25)
    assert player(tab, "p.panels[0].ghosts.size") == 1
    row = player(tab, "p.figure.time_s.findIndex(t => t >= 1.75)")
    curve = player(tab, f"p.panels[0].ghosts.values().next().value[{row}]")
    joint = np.rad2deg(arm[player(tab, "p.panels[0].panel.key")].value)
    then = player(tab, f"p.figure.time_s[{row}]") - 1.0 + 2.5
    assert curve == pytest.approx(np.interp(then, arm.time_s, joint), abs=0.02)
    player(tab, "p.seek(0.2)")
    assert player(tab, "p.ghost_s") is None, "outside of all spans there is no ghost"


def test_a_ghost_of_another_track(opened, arm_page, slow):
    tab = opened(arm_page)
    tab.get_by_label("Ghost").select_option("other")
    player(tab, "p.seek(2.0)")
    then = player(tab, "p.ghost_s")
    assert then == pytest.approx(2.0, abs=0.05)
    assert_there(tab, slow, "hand", then, "ghost")
    assert tab.locator(".op-key.op-ghost").is_visible()
    tab.get_by_label("Ghost").select_option("")
    assert player(tab, "p.ghost_s") is None


def test_uncertainty_is_shown_and_said(opened, arm_page, arm):
    tab = opened(arm_page)
    player(tab, "p.seek(3.0)")
    plain = tab.locator(".op-stage").screenshot()
    tab.get_by_label("Uncertainty").select_option("10")
    settle(tab)
    assert tab.locator(".op-stage").screenshot() != plain
    said = tab.locator(".op-spread").inner_text()
    largest = max(
        np.sqrt(np.trace(arm.frame_position_spread(f).covariance_m2[np.searchsorted(arm.time_s, 3.0)]))
        for f in arm.model.frame_names
    )
    assert "95 %" in said
    assert float(said.split("±")[1].split()[0]) == pytest.approx(2.7955e3 * largest, rel=0.1, abs=0.1)
    assert player(tab, "p.panels[0].data().length") == 4, "time, value and both edges of the band"
    assert "±" in tab.locator(".op-values").first.inner_text()


def test_what_is_shown_says_so(opened, arm_page, rower_page):
    tab = opened(arm_page, 390, 844)
    assert tab.get_by_label("aligned by").is_hidden()
    tab.get_by_label("Ghost").select_option("own 1")
    assert tab.get_by_label("aligned by").is_visible()
    open_, all_ = (tab.locator(f".op-panel{which}").count() for which in (":not([hidden])", ""))
    assert tab.locator(".op-chooser summary").text_content() == f"Curves: {open_} of {all_} shown"
    assert 0 < open_ < all_
    tab.locator(".op-chooser summary").click()
    tab.locator(".op-boxes input:not(:checked)").first.click()
    assert tab.locator(".op-chooser summary").text_content() == f"Curves: {open_ + 1} of {all_} shown"
    tab = opened(rower_page, 1280, 900)
    assert tab.locator(".op-key.op-loop").text_content() == "hands hold the handles"
    assert not tab.get_by_label("Names").is_checked(), "a rower has too many to show at once"


def test_curves_are_chosen(opened, arm_page):
    tab = opened(arm_page)
    tab.locator("summary").click()
    curve = tab.get_by_label(player(tab, "p.panels.find((panel) => !panel.shown).panel.label + ', deg'"))
    curve.check()
    assert player(tab, "p.headTimes_s.length") == 5
    curve.uncheck()
    assert player(tab, "p.headTimes_s.length") == 4


@pytest.mark.parametrize("size", WIDTHS)
def test_nothing_sticks_out_and_everything_has_a_name(opened, rower_page, size):
    tab = opened(rower_page, *size)
    assert tab.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    nameless = tab.evaluate(
        """() => [...document.querySelectorAll('button, input, select, canvas')]
            .filter(e => !e.closest('[role=img][aria-label]') && !e.getAttribute('aria-label'))
            .filter(e => !(e.labels && e.labels.length)).map(e => e.outerHTML)"""
    )
    assert nameless == []
    tab.get_by_label("Names").check()
    settle(tab)
    boxes = tab.evaluate(
        """() => [...document.querySelectorAll('.op-names span:not([hidden])')]
            .map(e => e.getBoundingClientRect().toJSON())"""
    )
    assert boxes
    for k, one in enumerate(boxes):
        for other in boxes[:k]:
            apart = one["left"] >= other["right"] - 4 or other["left"] >= one["right"] - 4
            assert apart or one["top"] >= other["bottom"] - 2 or other["top"] >= one["bottom"] - 2


def test_several_players_in_one_page(opened, arm, rower, tmp_path):
    pieces = [embed(scene(t), f"p{k}", with_player=False) for k, t in enumerate((arm, rower, arm))]
    file = tmp_path / "three.html"
    head = '<!doctype html><html lang="en"><meta charset="utf-8"><title>three</title>'
    file.write_text(head + "".join(pieces) + player_assets() + player_assets(), encoding="utf-8")
    tab = opened(file)
    assert tab.evaluate("oarlock.players.length") == 3
    tab.evaluate("oarlock.players[1].seek(2)")
    assert tab.evaluate("oarlock.players.map(p => p.time_s > 1)") == [False, True, False]


def test_it_prints_as_a_still_picture(opened, rower_page):
    tab = opened(rower_page, color_scheme="dark")
    player(tab, "p.seek(3.0)")
    tab.emulate_media(media="print", color_scheme="light")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    settle(tab)
    assert not tab.get_by_role("button", name="Play").is_visible()
    assert tab.locator("canvas").first.is_visible()
    corner = tab.evaluate(
        """() => { const c = document.createElement('canvas'); const from = document.querySelector('.op-canvas canvas');
            c.width = from.width; c.height = from.height; const pen = c.getContext('2d'); pen.drawImage(from, 0, 0);
            return [...pen.getImageData(3, 3, 1, 1).data]; }"""
    )
    assert min(corner[:3]) > 200, "ink on white, whatever the screen shows"
    assert len(tab.pdf()) > 10_000


def test_without_webgl_the_figure_is_flat_and_the_page_says_so(driver, arm_page, arm):
    launched = driver.launch(executable_path=CHROMIUM, args=NO_WEBGL, timeout=HANGS_MS)
    complaints: list[str] = []
    tab = launched.new_page()
    tab.set_default_timeout(HANGS_MS)
    tab.on("console", lambda message: message.type == "error" and complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto(arm_page.as_uri())
    tab.wait_for_function("window.oarlock.players.length > 0")
    assert player(tab, "p.flat") is True
    assert "no WebGL" in tab.get_by_role("status").first.inner_text()
    before = tab.locator(".op-stage").screenshot()
    player(tab, "p.seek(3.0)")
    settle(tab)
    assert tab.locator(".op-stage").screenshot() != before
    assert_there(tab, arm, "hand", 3.0)
    tab.get_by_label("Uncertainty").select_option("10")
    tab.get_by_label("Ghost").select_option("other")
    settle(tab)
    launched.close()
    assert not complaints


def test_a_lost_context_becomes_a_flat_figure(opened, arm_page):
    tab = opened(arm_page)
    tab.evaluate(
        "document.querySelector('canvas').getContext('webgl2').getExtension('WEBGL_lose_context').loseContext()"
    )
    tab.wait_for_function("oarlock.players[0].flat")
    player(tab, "p.seek(2.0)")
    assert tab.get_by_text("no WebGL").is_visible()


def test_the_player_shows_the_moment_where_the_track_knows_it(arm, tmp_path, opened):
    shown = scene(arm, title="arm") | {"epoch": {"ms": 1.7e12, "dated": True, "zone": "UTC"}}
    (tmp_path / "dated.html").write_text(page(shown, "arm"), encoding="utf-8")
    tab = opened(tmp_path / "dated.html")
    player(tab, "p.seek(2.5)")
    settle(tab)
    assert tab.locator(".op-bar .op-time").all_inner_texts() == ["2.50 s", "2023-11-14 22:13:22.50 UTC"]
