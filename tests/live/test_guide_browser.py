"""The guided start in Chromium: a remote and a phone lead an emulated sculler to a calibrated, tracked session."""

import re
import time
from contextlib import contextmanager

import numpy as np
import pytest
from guided_session import GuidedSession
from scipy.spatial.transform import Rotation

import oarlock
from headless_chromium import HANGS_MS, chromium
from oarlock.live.folder import CALIBRATION, PLAN, RECORDING, LiveFolder

pytestmark = pytest.mark.long

NOT_TRIED = "THE GUIDED START WAS NOT TRIED IN A BROWSER"
GPU_STALL = "GPU stall"
MOUNT_RAD = float(np.radians(4.0))
"""What a calibration passes as a mount's standard deviation."""
MOST_TRIES = 60
"""Of 10 steps: a busy machine may spoil some."""


@contextmanager
def tab_of(browser, session, size):
    complaints = []
    still = "reduce" if size[0] < size[1] else "no-preference"
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, reduced_motion=still)
    tab = context.new_page()
    tab.set_default_timeout(HANGS_MS)
    tab.on("console", lambda message: complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto(session.url)
    tab.locator(".ol-guide").wait_for()
    yield tab
    context.close()
    assert not [text for text in complaints if GPU_STALL not in text]


def phase_of(tab, not_in):
    """The next phase that is none of these, with the step."""
    for _ in range(HANGS_MS // 50):
        phase, at = tab.evaluate("() => [oarlock.live.guide.state.phase, oarlock.live.guide.state.at]")
        if phase not in not_in:
            return phase, at
        time.sleep(0.05)
    raise AssertionError(f"still {phase}")


def fits(tab):
    """Nothing is wider than the screen, and the large button is on it."""
    box = tab.locator(".ol-guide-go").bounding_box()
    size = tab.viewport_size
    inside = box["y"] >= 0 and box["y"] + box["height"] <= size["height"]
    return inside and tab.evaluate("() => document.documentElement.scrollWidth <= innerWidth")


def lead(laptop, phone, session):
    """Presses through all steps: movements from the laptop, postures from the phone."""
    tried = []
    for _ in range(MOST_TRIES):
        phase, at = phase_of(laptop, ("countdown", "running", "checking"))
        if phase != "ready":
            return phase, tried
        name = session.guide.progress[at].step.name
        tried.append(name)
        assert laptop.locator(".ol-guide-title").inner_text().casefold() == name.casefold()
        phone.get_by_text(f"Step {at + 1} of 11").wait_for()
        for tab in (laptop, phone):
            tab.get_by_role("button", name="Start (space or page down)").wait_for()
            assert fits(tab)
        if session.guide.progress[at].step.kind == "pose":
            phone.get_by_role("button", name="Start").click()
        else:
            laptop.keyboard.press("PageDown")
        phase_of(laptop, ("ready",))
        laptop.locator(".ol-guide-number", has_text=re.compile(r"\d")).wait_for()
    raise AssertionError(f"the guide did not end: {tried}")


def test_an_emulated_sculler_is_led_to_a_calibrated_track(sculler, tmp_path):
    folder = tmp_path / "today"
    with chromium(NOT_TRIED) as browser, GuidedSession(sculler, folder) as session:
        with tab_of(browser, session, (1280, 860)) as laptop, tab_of(browser, session, (390, 844)) as phone:
            assert not laptop.evaluate("() => oarlock.live.health?.is_tracking")
            laptop.locator(".ol-guide-units li.ol-good").nth(4).wait_for()
            laptop.keyboard.press("Space")
            phone.get_by_role("button", name="Skip this step").click()
            laptop.locator(".ol-guide-title", has_text="N-pose").wait_for()
            phase, tried = lead(laptop, phone, session)
            if phase == "doubtful":
                assert all("rested" in doubt for doubt in session.guide.verdict.doubts)
                laptop.keyboard.press("Enter")
                phase, _ = phase_of(laptop, ("doubtful",))
            assert phase == "calibrated"
            phone.get_by_role("button", name="Start tracking").click()
            laptop.get_by_text("Tracking", exact=True).wait_for()
            laptop.locator(".ol-canvas canvas").wait_for()
            assert not laptop.locator(".ol-guide").is_visible()
            for _ in range(HANGS_MS // 50):
                if len(session.beliefs) > 200:
                    break
                time.sleep(0.05)
        session.end()
    assert {one.step.name for one in session.guide.progress if one.span_s} == set(tried)
    check(sculler, folder, session)


def check(model, folder, session):
    place = LiveFolder.load(folder)
    live = oarlock.load_calibration(folder / RECORDING / CALIBRATION)
    for name, (rotation, _) in live.mounts.items():
        planted = session.sculler.truth.mounts[name][0]
        assert Rotation.from_matrix(rotation @ planted.T).magnitude() < MOUNT_RAD, name
    plan = oarlock.calibration.load_session_plan(folder / RECORDING / PLAN)
    recording = oarlock.load_recording(folder / RECORDING)
    offline = oarlock.calibration.calibrate_session(model, recording, plan)
    for name, (rotation, _) in offline.mounts.items():
        np.testing.assert_array_equal(live.mounts[name][0], rotation)
    again = place.session(model)
    estimates = [one for packet in place.read() for one in again.take(packet)]
    assert len(estimates) == len(session.beliefs) > 200
    np.testing.assert_array_equal(estimates[-1].belief.mean, session.beliefs[-1].mean)
    part = recording.slice(start_s=again.from_s)
    whole = oarlock.track(model, part, calibration=live, config=again.config)
    np.testing.assert_array_equal(whole.last_belief.mean, session.beliefs[-1].mean)
