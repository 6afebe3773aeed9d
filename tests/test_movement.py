"""Ranges, cycles and sides of movements that are known, and the report of a body that does not row."""

import csv
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.cli.result import result_of
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
from oarlock.movement.blocks import MovementAnalysis
from oarlock.movement.evenness import changes, wanderings
from oarlock.movement.front import front_of
from oarlock.movement.movement import movement_of, settled_s
from oarlock.movement.range_section import ranges_markup
from oarlock.movement.report import write_movement_report
from oarlock.movement.words import key_figures, quality
from oarlock.tracking.track import track_without_filter

TIME_S = np.arange(0.0, 60.0, 0.01)


class ShortTrack(SimpleNamespace):
    """What the analysis reads of a track, which is known by its identity."""

    __hash__ = object.__hash__


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


def bends(start_s: float, size_deg: float = 35.0) -> np.ndarray:
    """Four bends of two seconds from rest."""
    moving = (start_s <= TIME_S) & (start_s + 8.0 >= TIME_S)
    return np.where(moving, size_deg * (1.0 - np.cos(np.pi * (TIME_S - start_s))), 0.0)


def test_short_blocks_of_four_are_all_found():
    angles = [angle("shoulder", bends(5.0)), angle("elbow", bends(22.0)), angle("wrist", bends(40.0))]
    found = sorted(find_cycles(TIME_S, angles), key=lambda one: one.begins_s[0])
    assert [one.lead for one in found] == ["shoulder", "elbow", "wrist"]
    for one, start_s in zip(found, (5.0, 22.0, 40.0), strict=True):
        assert (one.peaks, one.count) == (4, 3), "three whole cycles from the first to the last of four peaks"
        np.testing.assert_allclose(one.begins_s, start_s + 1.0 + 2.0 * np.arange(4), atol=0.05)


def test_time_that_is_taken_is_not_searched():
    angles = [angle("shoulder", bends(5.0))]
    taken = find_cycles(TIME_S, angles)
    assert len(taken) == 1
    assert find_cycles(TIME_S, angles, taken) == ()


def test_ranges_have_the_stds_of_their_ends():
    value = 10.0 + 40.0 * np.sin(TIME_S)
    std = np.where(value > 30.0, 3.0, 4.0)
    (one,) = ranges_of_motion([MovementAngle("elbow", "", value, std)]).values()
    assert (one.lowest_deg, one.highest_deg) == pytest.approx((-30.0, 50.0), abs=1e-3)
    assert one.range_std_deg == pytest.approx(5.0)


def test_numbers_count_from_when_the_uncertainty_has_fallen():
    std = 1.0 + 30.0 * np.exp(-TIME_S / 0.2)
    falling = MovementAngle("elbow", "", np.zeros_like(TIME_S), std)
    even = angle("wrist", np.zeros_like(TIME_S))
    # 30 exp(-t / 0.2) is a quarter of 1 at 0.2 ln(120)
    assert settled_s(TIME_S, [even, falling]) == pytest.approx(0.2 * np.log(120.0), abs=0.011)
    assert settled_s(TIME_S, [even]) == TIME_S[0]
    unknown = MovementAngle("knee", "", np.zeros_like(TIME_S), np.full_like(TIME_S, np.nan))
    assert settled_s(TIME_S, [unknown]) == TIME_S[0]


def test_an_offset_that_both_ends_share_is_not_in_a_range_of_cycles():
    begins = np.arange(0.0, 60.0, 2.0)
    swing = 20.0 * np.sin(np.pi * TIME_S)
    steady, drifting = (angle(name, swing + drift) for name, drift in (("a", 0.0), ("b", 0.3 * TIME_S)))
    found = cycle_ranges(TIME_S, [steady, drifting], begins)
    # A drift of 0.3 deg/s over the second between both ends changes each range by the same 0.3 deg.
    assert found["b"].range_deg == pytest.approx(found["a"].range_deg, abs=0.5)
    assert found["b"].range_std_deg == pytest.approx(found["a"].range_std_deg, rel=0.01)
    assert found["a"].well_measured
    (rough,) = cycle_ranges(TIME_S, [angle("c", swing, 5.0)], begins).values()
    assert not rough.well_measured


CYCLES = 15
MOVED_S = np.arange(0.0, 2.0 * CYCLES + 1.0, 0.02)


def moved(
    monkeypatch, changes_deg: dict[str, np.ndarray], seed: int = 0, **provenance: str
) -> MovementAnalysis:
    """An elbow and a wrist that swing every two seconds with noise in each cycle, and what is added to them."""
    random = np.random.default_rng(seed)
    cycle = np.minimum(MOVED_S // 2.0, CYCLES).astype(int)
    found = []
    for name, size in (("elbow_flexion_r", 30.0), ("wrist_flexion_r", 10.0)):
        swing = size * (1.0 + 0.02 * random.normal(size=CYCLES + 1))[cycle] * np.cos(np.pi * MOVED_S)
        value = swing + 0.5 * random.normal(size=CYCLES + 1)[cycle] + changes_deg.get(name, 0.0)
        found.append(MovementAngle(name, "", value, np.full_like(value, 1.0)))
    monkeypatch.setattr("oarlock.movement.movement.movement_angles", lambda track, turns: tuple(found))
    monkeypatch.setattr("oarlock.movement.movement.room_angles", lambda track, turns: ())
    monkeypatch.setattr("oarlock.movement.movement.SegmentTurns", lambda track: None)
    return movement_of(ShortTrack(time_s=MOVED_S, provenance=provenance, info=None))


def test_a_planted_change_is_found_and_even_cycles_report_nothing(monkeypatch):
    tired = np.where(MOVED_S > 20.0, -4.0, 0.0) * np.cos(np.pi * MOVED_S)
    movement = moved(monkeypatch, {"elbow_flexion_r": tired})
    (*_, found) = (one for one in changes(movement, *movement.blocks) if one.certain)
    assert found.angle == "elbow_flexion_r"
    assert found.difference == pytest.approx(-8.0, abs=found.limit)
    reported = [
        any(one.certain for test in (changes, wanderings) for one in test(movement, *movement.blocks))
        for movement in (moved(monkeypatch, {}, seed) for seed in range(20))
    ]
    # Chance reports at most 5 %: more than three of twenty have a probability of 1.6 %.
    assert sum(reported) <= 3


def test_a_drift_is_a_finding_and_never_even(monkeypatch):
    drift = {"wrist_flexion_r": 20.0 * MOVED_S / MOVED_S[-1]}
    front = front_of(moved(monkeypatch, drift, nominal_mounts="['hand_r']", model="arm"))
    (point,) = front.points
    assert point.head == "Drift"
    # 14 steps between the middles of 15 cycles, 18 deg, with the noise of both ends.
    assert re.search(r"right wrist flexion wandered by 1[789]°", point.sentence)
    assert front.next_step.startswith("Calibrate the sensors first")
    assert "oarlock calibrate session --model arm" in front.commands[0][1]
    assert "middle of right wrist flexion" in front.checked
    assert "right wrist flexion" not in [one.name for one in front.figures], "a drift or a change of posture"
    calm = front_of(moved(monkeypatch, {}))
    assert not calm.points
    assert "a change above" in calm.quiet and "of the cycle time" in calm.quiet
    assert not calm.commands and "would show" in calm.next_step


def test_what_is_not_measured_well_is_no_key_figure_and_shown_apart(monkeypatch):
    movement = moved(monkeypatch, {})
    (block,) = movement.blocks
    rough = replace(block.ranges["wrist_flexion_r"], lowest_std_deg=8.0)
    movement = replace(movement, blocks=(replace(block, ranges={**block.ranges, "wrist_flexion_r": rough}),))
    assert [one.name for one in key_figures(movement)] == ["repetitions", "cycle", "right elbow flexion"]
    markup = ranges_markup(movement)
    assert markup.index("right elbow flexion") < markup.index("Not measured well enough")
    assert markup.index("Not measured well enough") < markup.index("right wrist flexion")
    # The elbow moves by 60 deg, the wrist has no norm.
    assert "146° of elbow flexion" in markup and "pronation" not in markup
    assert "95 % upper limit" in markup and "at most" not in markup


def test_the_front_says_what_is_measured_well_and_why_the_rest_is_not(monkeypatch):
    movement = moved(monkeypatch, {})
    (block,) = movement.blocks
    rough = replace(block.ranges["wrist_flexion_r"], lowest_std_deg=8.0)
    movement = replace(movement, blocks=(replace(block, ranges={**block.ranges, "wrist_flexion_r": rough}),))
    well, badly = (sentence.replace("\u00a0", " ") for sentence in quality(movement))
    assert re.fullmatch(r"Range measured well: right elbow flexion \d+ ± 3°\.", well)
    assert re.fullmatch(r"Not measured well: right wrist flexion \d+ ± 16° \(the estimate drifts\)\.", badly)
    many = {
        f"knee_{k}": replace(rough, name=f"knee_{k}", highest_deg=40.0 + k, lowest_std_deg=1.0)
        for k in range(9)
    }
    (told,) = quality(replace(movement, blocks=(replace(block, ranges=many),), ranges={}))
    assert told.startswith("Range measured well: knee 8") and told.endswith("and 5 more.")


def test_few_cycles_are_asked_for_more(monkeypatch):
    movement = moved(monkeypatch, {})
    (block,) = movement.blocks
    short = replace(block.repetition, begins_s=block.repetition.begins_s[:4])
    front = front_of(replace(movement, blocks=(replace(block, repetition=short),)))
    assert front.quiet == (
        "3 whole cycles are too few to compare the first with the last third: that needs 6 (7 repetitions)."
    )
    assert "with 7 or more repetitions: then the first can be compared with the last" in front.next_step
    assert "7 or more" not in front_of(movement).next_step


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
    rough = replace(one, right=replace(one.right, highest_deg=200.0, lowest_std_deg=40.0))
    assert rough.difference_deg > rough.limit_deg and not rough.certain, "one side is not measured well"


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
def session() -> oarlock.Track:
    """An arm that bows, swings and bends its elbow, four times each, without a filter's standard deviations."""
    model = oarlock.load_model("arm", stature_m=1.78, mass_kg=75)
    q = np.zeros((len(TIME_S[::2]), len(model.coordinate_names)))
    for name, start_s in (("thorax.rz", 8.0), ("shoulder_r.rz", 24.0), ("elbow_flexion_r", 40.0)):
        sign = -1.0 if name == "thorax.rz" else 1.0
        q[:, model.coordinate_names.index(name)] = sign * np.radians(bends(start_s)[::2])
    return track_without_filter(model, TIME_S[::2], q, provenance={})


def test_every_block_of_a_session_is_on_the_page(session, tmp_path):
    page, table = write_movement_report(session, tmp_path / "report.html")
    text = page.read_text(encoding="utf-8")
    leads = ("thorax tilt", "right shoulder flexion", "right elbow flexion")
    assert "repeated thorax tilt, right shoulder flexion and right elbow flexion" in text
    for number, (lead, start_s) in enumerate(zip(leads, (9, 25, 41), strict=True), 1):
        when = f"Block {number}, {start_s} to {start_s + 6} s: "
        assert (
            f"{when}4 repetitions (3 whole cycles) of {lead}. Ranges: {lead} 70°; the track does not say"
            in text
        )
        assert f"{when}{lead}, 4 repetitions (3 whole cycles)" in text
        assert f'id="ranges-{number}-table"' in text and f"block {number}, {lead} 3" in text
    assert "with 7 or more repetitions" in text
    assert "146° of elbow flexion" in text and "supination" not in text, "norms of what was tested"
    assert "sequence ZXY" in text and "plane of elevation, elevation, axial rotation" not in text
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [(row["block"], row["cycle"]) for row in rows] == [(b, c) for b in "123" for c in "123"]
    assert float(rows[0]["thorax_tilt_range_deg"]) == pytest.approx(70.0, abs=0.5)
    assert float(rows[8]["elbow_flexion_r_range_deg"]) == pytest.approx(70.0, abs=0.5)


def test_the_free_segment_is_no_angle_of_a_block_that_joints_lead(reaches, session):
    assert {one.name for one in movement_of(session).angles} >= {"thorax_tilt", "thorax_rotation"}
    (block,) = movement_of(reaches).blocks
    assert {one.name for one in block.angles} == {one.name for one in movement_angles(reaches)}


def test_report_and_terminal_share_one_analysis(reaches, tmp_path, monkeypatch):
    oarlock.write_report(reaches, tmp_path / "report.html")
    monkeypatch.setattr("oarlock.movement.movement.movement_angles", None)
    assert result_of(reaches)["angles"]


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
    run("report", tmp_path / "out", "--out", tmp_path / "other.html")
    assert (tmp_path / "other-cycles.csv").exists()
