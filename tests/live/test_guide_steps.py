"""The course of a guided start: presses, times and verdicts in; commands, cuts and judgements out."""

import pytest

from oarlock.calibration import SessionPlan, SessionStep
from oarlock.live.guide.steps import CheckSteps, Cut, Guide, GuideDurations, Listen, Send, Swap
from oarlock.live.guide.verdict import Verdict

PLAN = SessionPlan(
    "short",
    (
        SessionStep("table", "turn"),
        SessionStep("stand", "pose"),
        SessionStep("bend", "move", joints=("elbow",)),
        SessionStep("zero", "mark", stream="seat", start_s=1.0, end_s=2.0),
    ),
)
PACE = GuideDurations(countdown_s=3.0, seconds={"turn": 20.0, "pose": 4.0, "move": 12.0}, settle_s=0.5)
GOOD, BAD = ("pass", "Fine."), ("redo", "It was too small.")


def led(phase="offered"):
    return Guide(PLAN, PACE, phase)


def done(guide, start_s):
    """Does the step that is shown, at `start_s`; the orders at its end."""
    assert guide.press("go", start_s) == [Listen()]
    assert guide.tick(start_s + 3.0) == [] and guide.phase == "running"
    return guide.tick(guide.ends_s + 0.6)


def verdict(guide, passed=False, calibration="format = 1", exchanged=(), doubts=(), **steps):
    names = {one.step.name for one in guide.progress if one.span_s is not None}
    return Verdict(
        guide.tasks, {n: steps.get(n, GOOD) for n in names}, passed, tuple(doubts), calibration, exchanged
    )


def begun(skip_table=True):
    guide = led()
    guide.press("go", 0.0)
    if skip_table:
        guide.press("skip", 0.0)
    return guide


def test_it_begins_with_the_first_step_and_stops_tracking():
    guide = led()
    assert guide.is_open and guide.press("go", 0.0) == [Send("stop")]
    assert (guide.phase, guide.at) == ("ready", 0)
    assert [one.step.name for one in guide.progress] == ["table", "stand", "bend"], "marks need no person"


def test_a_step_is_counted_down_done_cut_and_judged():
    guide = begun()
    orders = done(guide, 10.0)
    span = (13.0, 17.0)
    (step,) = [one for one in orders if isinstance(one, CheckSteps)]
    assert orders[:2] == [
        Send("step", {"name": "stand", "begin_s": 13.0, "end_s": 17.0}),
        Cut("stand", span),
    ]
    assert [(s.name, s.span_s) for s in step.plan.steps] == [("stand", span)]
    assert guide.phase == "checking"
    assert guide.judged(verdict(guide)) == []
    assert (guide.phase, guide.at, guide.progress[1].outcome) == ("ready", 2, "pass")


def test_readings_that_are_late_are_awaited():
    guide = begun()
    guide.press("go", 0.0)
    guide.tick(3.0)
    assert guide.tick(7.4) == []
    assert guide.tick(7.6, heard_s=7.2) == [], "a slow radio holds readings up"
    assert guide.tick(7.6, heard_s=7.4)


def test_readings_that_never_come_are_not_awaited_for_ever():
    guide = begun()
    guide.press("go", 0.0)
    guide.tick(3.0)
    assert guide.tick(11.9, heard_s=5.0) == [] and guide.tick(12.1, heard_s=5.0)


def test_a_failed_step_is_done_again_alone():
    guide = begun()
    done(guide, 0.0)
    guide.judged(verdict(guide))
    done(guide, 20.0)
    guide.judged(verdict(guide, bend=BAD))
    assert (guide.phase, guide.at) == ("ready", 2)
    assert guide.told()["steps"][2] == {"outcome": "redo", "sentence": "It was too small."}
    orders = done(guide, 60.0)
    assert [(s.name, s.start_s) for s in orders[-1].plan.steps] == [("stand", 3.0), ("bend", 63.0)]
    assert guide.judged(verdict(guide, passed=True)) == [Send("calibrate", {"toml": "format = 1"})]
    assert guide.phase == "calibrated"


def test_an_earlier_step_that_later_ones_contradict_is_done_again():
    guide = begun()
    done(guide, 0.0)
    guide.judged(verdict(guide))
    done(guide, 20.0)
    guide.judged(verdict(guide, stand=BAD))
    assert (guide.phase, guide.at) == ("ready", 1)


def test_all_is_tracked_after_the_last_press():
    guide = begun()
    for start_s in (0.0, 20.0):
        done(guide, start_s)
        orders = guide.judged(verdict(guide, passed=True))
    assert orders == [Send("calibrate", {"toml": "format = 1"})]
    assert guide.press("go", 60.0) == [Send("track")]
    assert not guide.is_open


def test_doubts_need_a_decision():
    guide = begun()
    for start_s in (0.0, 20.0):
        done(guide, start_s)
        orders = guide.judged(verdict(guide, doubts=["back: uncertain"]))
    assert (orders, guide.phase) == ([], "doubtful")
    assert guide.told()["doubts"] == ["back: uncertain"]
    assert guide.press("go", 60.0) == [Send("calibrate", {"toml": "format = 1"})]


@pytest.mark.parametrize("what", ["back", "leave"])
def test_a_step_can_be_broken_off(what):
    guide = begun()
    guide.press("go", 0.0)
    guide.tick(3.0)
    assert guide.press(what, 4.0) == []
    assert guide.phase == {"back": "ready", "leave": "closed"}[what]
    assert guide.tick(60.0) == []


def test_back_goes_to_the_step_before_and_stops_at_the_first():
    guide = begun()
    assert guide.at == 1
    guide.press("back", 0.0)
    guide.press("back", 0.0)
    assert (guide.at, guide.phase) == (0, "ready")


def test_a_verdict_on_a_step_that_is_done_again_is_ignored():
    guide = begun()
    done(guide, 0.0)
    late = verdict(guide)
    guide.press("back", 8.0)
    assert guide.judged(late) == [] and guide.phase == "ready" and guide.progress[1].outcome == ""
    done(guide, 20.0)
    assert guide.judged(late) == [] and guide.phase == "checking"


def test_a_skipped_step_that_was_done_no_longer_counts():
    guide = begun()
    done(guide, 0.0)
    guide.judged(verdict(guide))
    done(guide, 20.0)
    guide.judged(verdict(guide, bend=BAD))
    orders = guide.press("skip", 50.0)
    assert orders[0] == Send("step", {"name": "bend", "begin_s": None, "end_s": None})
    assert [s.name for s in orders[1].plan.steps] == ["stand"], "the calibration is found without it"
    assert guide.judged(verdict(guide, passed=True))


def test_nothing_begins_while_a_unit_is_not_heard_and_silence_breaks_a_step_off():
    guide = begun()
    assert guide.press("go", 0.0, ["back"]) == []
    assert guide.phase == "ready" and "back" in guide.problem
    guide.press("go", 1.0)
    guide.tick(5.0)
    assert guide.tick(6.0, ["back"]) == []
    assert guide.phase == "ready" and "back fell silent" in guide.problem


def test_a_press_ends_a_step_that_has_lasted_long_enough():
    guide = begun()
    guide.press("go", 0.0)
    guide.press("go", 1.0)
    guide.tick(1.0)
    assert (guide.phase, guide.begins_s) == ("running", 1.0)
    guide.press("go", 2.0)
    assert guide.ends_s == 5.0
    guide.press("go", 4.5)
    assert guide.ends_s == 4.5


def test_two_exchanged_units_swap_their_devices_and_all_is_done_again():
    guide = begun()
    done(guide, 0.0)
    guide.judged(verdict(guide, stand=BAD, exchanged=("right", "left")))
    assert guide.told()["exchanged"] == ["right", "left"]
    orders = guide.press("swap", 20.0)
    assert orders[0] == Swap(("right", "left"))
    assert orders[1:] == [Send("step", {"name": "stand", "begin_s": None, "end_s": None})]
    assert (guide.phase, guide.at) == ("ready", 0) and not guide.told()["exchanged"]
    assert guide.press("swap", 21.0) == []


def test_nothing_measured_is_no_calibration():
    guide = begun()
    guide.press("skip", 0.0)
    assert guide.press("skip", 0.0) == []
    assert guide.phase == "ready" and "at least one step" in guide.problem


def test_with_known_mounts_it_waits_to_be_opened():
    guide = led("closed")
    assert not guide.is_open and guide.press("go", 0.0) == []
    guide.press("open", 0.0)
    assert guide.phase == "offered"
