"""The picture of a session's page: units on the body, their axes in words, verdicts by colour and sign."""

import re

import numpy as np
import pytest

import oarlock
from headless_chromium import driver_of_chromium, quiet_tabs
from oarlock.report.session_page import write_session_page
from oarlock.report.worn_picture import WornBody, pointing, unit_verdicts, worn_picture, worn_section

MOUNT = {"what": "mount", "subject": "pelvis", "std": 5.0, "limit": 4.0, "outcome": "redo"}


def worn(names, q=None, turn=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """A body with these units in the axes `turn` of their segments."""
    body = oarlock.load_model("full_body").with_units(names)
    mounts = {s.name: (np.asarray(turn), np.asarray(s.mount.offset)) for s in body.describe().inertial_units}
    at_rest = np.concatenate([np.ravel(joint.rest) for joint in body.describe().joints])
    verdicts = dict.fromkeys(mounts, ("good", "± 1.0°"))
    return WornBody.of(body, at_rest if q is None else q, oarlock.Calibration(mounts=mounts), verdicts)


def test_axes_in_words():
    figure = worn(["pelvis", "thorax"])
    (pelvis, _) = figure.units
    words = [pointing(axis, figure.body, figure.right) for axis in pelvis.root_from_sensor.T]
    assert words == ["forward", "up", "right"]
    tilted = np.array([np.sin(np.radians(30.0)), -np.cos(np.radians(30.0)), 0.0])
    assert pointing(tilted, figure.body, figure.right) == "down, 30° forward"


def test_each_side_is_seen_from_its_side():
    figure = worn(["pelvis", "thigh_r", "thigh_l", "shank_l"])
    seen = {view.title: {unit.name for unit in units} for view, units in figure.panels()}
    assert seen["from the right"] == {"pelvis", "thigh_r"} and seen["from the left"] == {"thigh_l", "shank_l"}
    assert len(seen["from the front"]) == 4
    left_only = worn(["thorax", "upper_arm_l", "forearm_l"])
    assert [view.title for view, _ in left_only.panels()] == ["from the front", "from the left"]


def test_an_axis_that_points_to_the_reader_is_a_ring():
    drawn = worn_picture(worn(["pelvis", "thorax"]))
    right, front = drawn.split("<figure>")[1:]
    assert right.count('class="worn-ring axis-z"') == 2 and right.count('class="worn-dot axis-z"') == 2
    assert front.count('class="worn-ring axis-x"') == 2 and "worn-ring axis-z" not in front
    away = worn_picture(worn(["pelvis", "thorax"], turn=np.diag([-1.0, 1.0, -1.0]))).split("<figure>")[1]
    assert away.count('class="worn-ring axis-z"') == 2 and "worn-dot" not in away


def test_names_do_not_cover_each_other():
    for panel in worn_picture(
        worn([s.name for s in oarlock.load_model("full_body").describe().inertial_units])
    ).split("<figure>")[1:]:
        places = re.findall(r'class="worn-name" x="([\d.]+)" y="([\d.]+)"', panel)
        for column in {x for x, _ in places}:
            heights = sorted(float(y) for x, y in places if x == column)
            assert (np.diff(heights) > 26.0).all()  # two lines of text


def test_verdicts():
    heading = unit_verdicts([MOUNT], {"pelvis": 4.9})
    assert heading == {"pelvis": ("unsure", "heading ± 5°")}
    assert unit_verdicts([MOUNT], {"pelvis": 1.0}) == {"pelvis": ("bad", "± 5°")}
    bias = {"what": "gyroscope's bias", "subject": "pelvis", "outcome": "redo"}
    passed = {**MOUNT, "std": 1.04, "outcome": "pass"}
    assert unit_verdicts([passed, bias], {}) == {"pelvis": ("bad", "gyroscope's bias")}
    assert unit_verdicts([passed], {}) == {"pelvis": ("good", "± 1.0°")}


@pytest.fixture(scope="module")
def session():
    body = oarlock.load_model("arm")
    plan = oarlock.calibration.default_plan(body, "T")
    trial = oarlock.simulation.simulate_session(
        body, plan, oarlock.simulation.SessionErrors(mount_rad=2.5), seed=1
    )
    return body, dict(plan.steps[0].pose), oarlock.calibration.calibrate_session(body, trial.recording, plan)


def test_the_section_shows_every_unit(session):
    body, pose, found = session
    markup = worn_section(found, body, pose)
    for name in found.mounts:
        assert f">{name}</text>" in markup and f">{name}</th>" in markup
    assert "points to you" in markup


def test_the_page_at_two_widths(session, tmp_path):
    body, pose, found = session
    page = write_session_page(found, tmp_path / "page.html", body, pose)
    with driver_of_chromium("the picture") as driver:
        browser = driver.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        with quiet_tabs(browser, ()) as open_:
            for width in (1280, 390):
                tab = open_(page, width)
                assert tab.evaluate("document.documentElement.scrollWidth") <= width
                boxes = tab.evaluate(
                    "[...document.querySelectorAll('.worn svg')].flatMap(s => "
                    "[...s.querySelectorAll('text')].map(t => {"
                    "const a = s.getBoundingClientRect(), b = t.getBoundingClientRect();"
                    "return [b.left - a.left, a.right - b.right, b.top - a.top, a.bottom - b.bottom]}))"
                )
                assert boxes and min(min(box) for box in boxes) > -1.0  # inside their pictures
        browser.close()
