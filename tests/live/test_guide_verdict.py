"""What is said of the steps of a guided start, on simulated sessions: the same as offline, and who sits where."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import oarlock
from oarlock.calibration.session.exchanged import exchanged_units
from oarlock.live.guide.steps import timed
from oarlock.live.guide.verdict import Task, joined, judged
from oarlock.recording.calibration import parsed_calibration

REST_S = 1.0
PAD_S = 0.3


@pytest.fixture(scope="module")
def trial(sculler):
    """A careful sculler with units in any orientation."""
    return oarlock.simulation.simulate_session(
        sculler, errors=oarlock.simulation.SessionErrors(mount_rad=1.0), seed=2
    )


@pytest.fixture(scope="module")
def plan(trial):
    """The steps with their times; movements begin with a rest."""
    moves = {s.name for s in trial.plan.steps if s.kind == "move"}
    spans = {n: (round(a - REST_S * (n in moves), 3), round(b, 3)) for n, (a, b) in trial.spans.items()}
    return timed(trial.plan, spans | {"units on the table": (0.5, 40.0)})


def parts_of(recording, plan):
    return [recording.slice(start_s=s.start_s - PAD_S, end_s=s.end_s + PAD_S) for s in plan.steps]


def exchanged(recording, one, other):
    streams = {s.name: s for s in recording.streams}
    streams[one], streams[other] = (
        replace(streams[other], name=one),
        replace(streams[one], name=other),
    )
    return oarlock.Recording(list(streams.values()))


def test_the_verdict_is_the_offline_calibration_of_the_whole_recording(sculler, trial, plan):
    found = judged(Task(1, sculler, plan, parts_of(trial.recording, plan), None))
    offline = oarlock.calibration.calibrate_session(sculler, trial.recording, plan)
    assert found.passed and found.steps.keys() == {s.name for s in plan.steps}
    calibration = parsed_calibration(found.calibration)
    assert calibration.noted == offline.noted
    for name, (rotation, _) in offline.mounts.items():
        np.testing.assert_array_equal(calibration.mounts[name][0], rotation)
        np.testing.assert_array_equal(calibration.gyro_biases_rad_s[name], offline.gyro_biases_rad_s[name])


def test_the_last_step_without_rest_is_to_be_done_again(sculler, trial, plan):
    swing = trial.spans["arm swing"]
    wrong = timed(trial.plan, {"N-pose": (swing[0] + 0.5, swing[0] + 4.5)})
    found = judged(Task(1, sculler, wrong, parts_of(trial.recording, wrong), None))
    assert found.steps["N-pose"][0] == "redo"
    assert "r_forearm, l_upperarm, l_forearm did not rest" in found.steps["N-pose"][1]


def test_readings_that_are_missing_are_a_failed_step(sculler, trial, plan):
    brief = replace(plan, steps=plan.steps[:2])
    few = [trial.recording.slice(start_s=0.0, end_s=0.2)]
    outcome, sentence = judged(Task(1, sculler, brief, few, None)).steps["N-pose"]
    assert outcome == "redo" and sentence


def test_parts_that_overlap_are_joined_without_repetition(trial):
    whole = trial.recording.slice(start_s=10.0, end_s=14.0)
    again = joined([whole.slice(start_s=10.0, end_s=12.5), whole.slice(start_s=12.0, end_s=14.0)])
    for stream in whole.streams:
        np.testing.assert_array_equal(again[stream.name].time_s, stream.time_s)
        np.testing.assert_array_equal(again[stream.name].gyro_rad_s, stream.gyro_rad_s)


def test_units_that_sit_right_are_not_called_exchanged(sculler, trial, plan):
    for count in range(2, len(plan.steps) + 1):
        assert not exchanged_units(sculler, trial.recording, replace(plan, steps=plan.steps[:count]))


PAIRS = list(combinations(("back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm"), 2))


@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_every_pair_of_exchanged_units_is_named(sculler, trial, plan, one, other):
    found = judged(Task(1, sculler, plan, parts_of(exchanged(trial.recording, one, other), plan), None))
    assert not found.passed
    assert set(found.exchanged) == {one, other}
