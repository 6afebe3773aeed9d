"""Ranges, cycles and sides of movements that are known, and the report of a body that does not row."""

import csv
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.movement import (
    MovementAngle,
    cycle_courses,
    cycle_ranges,
    find_cycles,
    movement_angles,
    ranges_of_motion,
    side_differences,
    side_pairs,
)
from oarlock.movement.report import write_movement_report
from oarlock.tracking.track import track_without_filter

TIME_S = np.arange(0.0, 60.0, 0.01)


def angle(name: str, value_deg: np.ndarray, std_deg: float = 1.0) -> MovementAngle:
    return MovementAngle(name, "", value_deg, np.full(len(value_deg), std_deg))


def gait(period_s: float, start_s: float, end_s: float, seed: int = 0) -> list[MovementAngle]:
    """Knees and hips that swing half a cycle apart between two times, and sway elsewhere."""
    random = np.random.default_rng(seed)
    moving = (start_s <= TIME_S) & (end_s >= TIME_S)
    phase = 2.0 * np.pi * (TIME_S - start_s) / period_s
    found = []
    for side, shift in (("r", 0.0), ("l", np.pi)):
        knee = 30.0 - 30.0 * np.cos(phase + shift) + 8.0 * np.sin(2.0 * (phase + shift))
        hip = 20.0 * np.sin(phase + shift + 0.5)
        for name, course in (("knee_flexion", knee), ("hip_flexion", hip)):
            sway = np.cumsum(random.normal(0.0, 0.05, len(TIME_S)))
            found.append(angle(f"{name}_{side}", np.where(moving, course, course[moving][0]) + sway))
    return found


@pytest.mark.parametrize("period_s", [0.6, 1.1, 2.3, 4.0])
def test_the_period_of_gait_is_found(period_s):
    (found, *_) = find_cycles(TIME_S, gait(period_s, 10.0, 45.0))
    assert found.period_s == pytest.approx(period_s, rel=0.01)
    # The largest knee angle is half a cycle after the start, so up to one cycle is missing at either end.
    assert 35.0 / period_s - 2.5 <= found.count <= 35.0 / period_s
    assert found.begins_s[0] >= 9.0 and found.begins_s[-1] <= 46.0
    # The knee is largest half a cycle after the start; the second harmonic moves it by less than a tenth.
    offset = (found.begins_s - 10.0) / period_s % 1.0
    assert np.ptp(offset) < 0.05


def test_cycles_begin_where_the_leading_angle_is_largest():
    angles = gait(1.2, 5.0, 50.0)
    (found, *_) = find_cycles(TIME_S, angles)
    lead = next(one for one in angles if one.name == found.lead)
    courses = cycle_courses(TIME_S, lead.value_deg, found.begins_s)
    assert courses.shape == (found.count, 101)
    assert (courses.argmax(axis=1) % 100 <= 5).all() or (courses.argmax(axis=1) % 100 >= 95).any()
    np.testing.assert_array_less(courses.mean(axis=0)[20:80], courses.mean(axis=0)[0])


@pytest.mark.parametrize("seed", range(12))
def test_movement_without_a_rhythm_has_no_cycles(seed):
    random = np.random.default_rng(seed)
    steps = random.normal(0.0, 1.0, (len(TIME_S), 4)).cumsum(axis=0)
    smooth = np.apply_along_axis(lambda v: np.convolve(v, np.ones(50) / 50.0, "same"), 0, steps)
    assert find_cycles(TIME_S, [angle(f"a{k}", smooth[:, k]) for k in range(4)]) == ()


def test_stillness_and_two_repeats_have_no_cycles():
    still = np.random.default_rng(0).normal(0.0, 0.5, len(TIME_S))
    assert find_cycles(TIME_S, [angle("elbow", still)]) == ()
    twice = np.where(TIME_S < 2.0, 40.0 * np.sin(np.pi * TIME_S) ** 2, 0.0)
    assert find_cycles(TIME_S, [angle("elbow", twice)]) == ()
    assert find_cycles(TIME_S[:1], [angle("elbow", still[:1])]) == ()


def test_two_rhythms_are_two_repetitions():
    slow = 30.0 * np.sin(2.0 * np.pi * TIME_S / 2.0)
    quick = 30.0 * np.sin(2.0 * np.pi * TIME_S / 0.8)
    found = find_cycles(TIME_S, [angle("elbow", np.where(TIME_S < 30.0, slow, quick))])
    assert [one.period_s for one in found[:2]] == pytest.approx([0.8, 2.0], rel=0.03)


def test_ranges_have_the_stds_of_their_ends():
    value = 10.0 + 40.0 * np.sin(TIME_S)
    std = np.where(value > 30.0, 3.0, 4.0)
    (one,) = ranges_of_motion([MovementAngle("elbow", "", value, std)]).values()
    assert (one.lowest_deg, one.highest_deg) == pytest.approx((-30.0, 50.0), abs=1e-3)
    assert one.range_std_deg == pytest.approx(5.0)


def test_a_difference_of_the_sides_is_certain_only_beyond_its_band():
    begins = np.arange(0.0, 60.0, 2.0)
    for right, std, certain in ((60.0, 1.0, True), (60.0, 5.0, False), (51.5, 0.1, False)):
        sides = [("knee_r", right), ("knee_l", 50.0)]
        angles = [angle(n, 0.5 * size * np.sin(np.pi * TIME_S), std) for n, size in sides]
        (one,) = side_differences(cycle_ranges(TIME_S, angles, begins))
        assert one.name == "knee"
        assert one.difference_deg == pytest.approx(right - 50.0, abs=0.05)
        assert one.std_deg == pytest.approx(2.0 * std, rel=0.01)
        assert one.certain is certain


def test_names_of_sides_pair():
    names = [
        "knee_r",
        "knee_l",
        "r_elbow",
        "l_elbow",
        "hip_right ZXY z",
        "hip_left ZXY z",
        "neck",
        "wrist_r",
        "raw",
    ]
    assert side_pairs(names) == {
        "knee": ("knee_r", "knee_l"),
        "elbow": ("r_elbow", "l_elbow"),
        "hip ZXY z": ("hip_right ZXY z", "hip_left ZXY z"),
    }


@pytest.fixture(scope="module")
def reaches() -> oarlock.Track:
    """An arm that reaches ten times in twenty seconds, without a filter's bands."""
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 30.0, 0.02)
    q = np.zeros((len(time_s), len(model.coordinate_names)))
    moving = (time_s >= 4.0) & (time_s <= 24.0)
    for k in range(q.shape[1]):
        q[:, k] = np.where(moving, 0.1 * (k + 1) * (1.0 - np.cos(np.pi * (time_s - 4.0))), 0.0)
    return track_without_filter(model, time_s, q, provenance={})


def test_angles_are_those_of_observed_joints(reaches):
    angles = movement_angles(reaches)
    assert [one.name for one in angles] == [
        j.name for j in reaches.model.describe().joints if j.kind == "hinge"
    ]
    np.testing.assert_allclose(angles[2].value_deg, np.degrees(reaches.q[:, 2]))


def test_the_report_begins_with_the_movement(reaches, tmp_path):
    page, table = write_movement_report(reaches, tmp_path / "report.html")
    text = page.read_text(encoding="utf-8")
    order = [
        text.index(f'id="{key}"') for key in ("moving", "ranges", "cycles", "measured", "notes", "provenance")
    ]
    assert order == sorted(order)
    assert "cycles of 2.00 s" in text
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(find_cycles(reaches.time_s, movement_angles(reaches))[0].begins_s) - 1
    first = movement_angles(reaches)[0].name
    for row in rows:
        assert float(row["duration_s"]) == pytest.approx(2.0, abs=0.02)
        assert float(row[f"{first}_range_deg"]) == pytest.approx(np.degrees(0.2), rel=0.01)


def test_a_body_that_nothing_repeats_has_no_table_of_cycles(reaches, tmp_path):
    still = track_without_filter(reaches.model, reaches.time_s[:150], reaches.q[:150], provenance={})
    assert write_movement_report(still, tmp_path / "report.html") == [tmp_path / "report.html"]
    assert 'id="cycles"' not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_verb_writes_both(reaches: oarlock.Track, tmp_path: Path):
    reaches.save(tmp_path / "out")
    run("report", tmp_path / "out")
    assert (tmp_path / "out" / "cycles.csv").exists()
    run("report", tmp_path / "out", "--to", tmp_path / "other.html")
    assert (tmp_path / "other-cycles.csv").exists()
