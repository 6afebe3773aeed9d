"""Units that their joints contradict: the first line of terminal and page, and no headline of their angles."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.movement.front import front_of
from oarlock.movement.movement import movement_of
from oarlock.movement.report import write_movement_report
from oarlock.movement.words import heading
from oarlock.tracking.notes import contradicted_units

UNITS = "thorax,upper_arm_r,forearm_r"


@pytest.fixture(scope="module")
def arm() -> oarlock.Model:
    return oarlock.load_model("arm").with_units(UNITS.split(","))


@pytest.fixture(scope="module")
def movement(arm: oarlock.Model) -> oarlock.Recording:
    """All joints sway after two seconds of rest; an elbow within its limits."""
    time_s = np.arange(0.0, 12.0, 0.1)
    grows = np.clip((time_s - 2.0) / 2.0, 0.0, 1.0) ** 2
    rates_hz = 0.4 + 0.07 * np.arange(len(arm.coordinate_names))
    q = 0.4 * grows[:, None] * np.sin(2.0 * np.pi * rates_hz * time_s[:, None])
    q[:, :3] = 0.0
    q[:, -2:] += 0.5
    motion = oarlock.simulation.Motion(tuple(arm.coordinate_names), time_s, q)
    _, recording = oarlock.simulate(arm, motion, rate_hz=60.0, seed=1)
    return recording


@pytest.fixture(scope="module")
def exchanged_axes(movement: oarlock.Recording) -> oarlock.Recording:
    """The gyroscope of the forearm has y and z exchanged."""
    streams = [
        replace(one, gyro_rad_s=one.gyro_rad_s[:, [0, 2, 1]]) if one.name == "forearm_r" else one
        for one in movement.streams
    ]
    return oarlock.Recording(streams)


def test_a_unit_with_right_axes_is_not_contradicted(arm, movement):
    track = oarlock.track(arm, movement)
    assert not contradicted_units(track.notes)
    assert any(one.well_measured for one in movement_of(track).shown if one.name.startswith("shoulder"))


def test_the_page_begins_with_the_contradiction_and_its_angles_are_no_headline(arm, exchanged_axes, tmp_path):
    track = oarlock.track(arm, exchanged_axes)
    assert "forearm_r" in contradicted_units(track.notes)
    found = movement_of(track)
    elbow = [one for one in found.shown if one.name.startswith("elbow")]
    assert elbow and not any(one.well_measured for one in elbow)
    assert {one.cause for one in elbow} == {"joints contradict its unit"}
    front = front_of(found)
    told = " ".join(
        [
            heading(found) or "",
            *(f"{one.name}" for one in front.figures),
            *(one.sentence for one in front.points),
            *(front.course.curves if front.course else ()),
        ]
    )
    assert "elbow" not in told
    assert front.next_step.startswith("Correct segment or mount") and not front.sensors_step
    page, *_ = write_movement_report(track, tmp_path / "report.html")
    lead = page.read_text(encoding="utf-8").partition("</h1>")[2]
    assert lead.startswith('<p class="trust bad">') and "forearm_r" in lead[: lead.index("</p>")]


def test_the_terminal_begins_with_the_contradiction(exchanged_axes, tmp_path: Path):
    exchanged_axes.save(tmp_path / "recording")
    words = ["track", tmp_path / "recording", "--model", "arm", "--sensors", UNITS, "--no-suspects"]
    printed = run(*words, "--out", tmp_path / "out").stdout
    assert printed.startswith("Do not rely on it: joints contradict the readings of")
    assert "forearm_r" in printed[: printed.index("open ")]
