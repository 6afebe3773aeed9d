"""A video in the player: it follows the slider, leads while it plays, carries the skeleton; nothing is fetched."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless_chromium import chromium, quiet_tabs
from oarlock.movement.video import video_info
from oarlock.movement.video.shown import shown_video
from oarlock.report.viewer import page, scene
from oarlock.rowing import rowing_look
from video_drawing import Motion, side_camera, write_video

pytestmark = pytest.mark.long
pytest.importorskip("av", reason="NO VIDEO WAS SHOWN: pip install av")

FRAME_S = 0.04
OFFSET_S = 2.3
PIXEL = 0.05
"""Places in the page are 16-bit steps, single precision, and straight between samples."""


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(12.0, 24.0, seed=4)


@pytest.fixture(scope="module")
def shown(motion: Motion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    stamps_s = np.arange(0.0, 6.0, FRAME_S)
    write_video(folder / "a piece.webm", motion, OFFSET_S + stamps_s, stamps_s)
    info = video_info(folder / "a piece.webm")
    drawn = scene(motion.track, look=rowing_look(motion.track), every_s=0.001)
    drawn["video"] = shown_video(
        folder / "a piece.webm", folder, info, offset_s=OFFSET_S, camera=side_camera()
    )
    (folder / "view.html").write_text(page(drawn, "video"), encoding="utf-8")
    return folder / "view.html"


@pytest.fixture(scope="module")
def browser():
    with chromium("THE VIDEO WAS NOT TRIED IN A BROWSER") as launched:
        yield launched


@pytest.fixture
def opened(browser):
    with quiet_tabs(browser, ("GPU stall", "willReadFrequently")) as open_:

        def open_ready(file: Path, *size: int) -> Any:
            tab = open_(file, *size)
            tab.wait_for_function("() => window.oarlock?.players?.[0]?.film.video.readyState >= 2")
            return tab

        yield open_ready


def shows(tab: Any, time_s: float) -> float:
    """Moves the slider and returns the track's time of the picture that is then shown, s."""
    tab.get_by_role("slider", name="Time").fill(str(time_s))
    tab.wait_for_function(
        f"() => {{ const f = oarlock.players[0].film; return !f.video.seeking && "
        f"Math.abs(f.pictureTime_s - {time_s}) <= {FRAME_S + 0.002}; }}"
    )
    return float(tab.evaluate("oarlock.players[0].film.pictureTime_s"))


@pytest.mark.parametrize("size", [(1280, 900), (390, 844)])
def test_the_picture_is_that_of_the_slider_and_the_skeleton_lies_on_it(opened, shown, motion, size):
    tab = opened(shown, *size)
    for asked in (3.0, 6.71, 4.44):
        at_s = shows(tab, asked)
        assert asked - FRAME_S - 0.002 <= at_s <= asked + 0.002
        names = tab.evaluate("oarlock.players[0].figure.points.map((p) => p.name)")
        found = tab.evaluate(f"oarlock.players[0].film.pixelsAt({at_s})")
        elbow = motion.track.frame_positions("r_elbow")
        place = np.array([np.interp(at_s, motion.track.time_s, elbow[:, k]) for k in range(3)])
        expected = side_camera().pixels(place) + 0.5
        np.testing.assert_allclose(found[names.index("r_elbow")], expected, rtol=0, atol=PIXEL)
    overlay = "document.querySelector('.op-overlay')"
    video = "document.querySelector('.op-video video')"
    box = "(e) => { const r = e.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; }"
    assert tab.evaluate(f"({box})({overlay})") == tab.evaluate(f"({box})({video})")
    inked = f"{overlay}.getContext('2d').getImageData(0, 0, {overlay}.width, {overlay}.height).data.some((v) => v)"
    assert tab.evaluate(inked)
    tab.get_by_label("Skeleton").uncheck()
    assert not tab.evaluate(inked)
    assert tab.evaluate("document.documentElement.scrollWidth") == size[0]


def test_outside_of_the_video_the_page_says_so_and_time_goes_on(opened, shown):
    tab = opened(shown)
    tab.get_by_role("slider", name="Time").fill("0.5")
    tab.get_by_text("The video has no picture at this time.").wait_for()
    tab.get_by_role("button", name="Play").first.click()
    tab.wait_for_function("() => oarlock.players[0].time_s > 3.0")
    # the video leads now: the page's time is that of its clock
    assert not tab.evaluate("oarlock.players[0].film.video.paused")
    off_s = tab.evaluate(
        "(() => { const p = oarlock.players[0]; return p.time_s - p.film.trackTime(p.film.video.currentTime); })()"
    )
    assert abs(off_s) < 0.25
    tab.wait_for_function("() => oarlock.players[0].time_s > 9.0")


def test_the_offset_can_be_moved_and_another_file_chosen(opened, shown):
    tab = opened(shown)
    tab.get_by_role("button", name="Video one picture earlier").click()
    assert float(tab.get_by_label("Offset, s").input_value()) == pytest.approx(OFFSET_S + FRAME_S, abs=1e-3)
    tab.get_by_label("Other file").set_input_files(shown.parent / "a piece.webm")
    tab.wait_for_function("() => oarlock.players[0].film.video.src.startsWith('blob:')")
    tab.wait_for_function("() => oarlock.players[0].film.video.readyState >= 2")
    tab.get_by_label("Other file").set_input_files(shown)
    tab.get_by_text("The browser cannot show this file").wait_for()
