"""A guided start in its recording: plan, calibration and track are found again from the packets alone."""

from dataclasses import replace

import numpy as np
import pytest
from senders import START_NS, packets_of, rig_of, with_test_format

import oarlock
from oarlock import rowing
from oarlock.live.folder import CALIBRATION, PLAN, RECORDING, LiveFolder
from oarlock.live.guide.steps import timed
from oarlock.live.guide.verdict import Task, judged
from oarlock.live.recorder import Recorder
from oarlock.live.rows import StreamBuffer
from oarlock.live.session import LiveSession, command
from oarlock.recording.calibration import parsed_calibration
from oarlock.rowing.simulation.guided import ERRORS

RATE_HZ = 50.0
PAD_S, REST_S = 0.3, 1.0
ROWED_S, BEFORE_TRACK_S = 8.0, 4.0


@pytest.fixture(scope="module")
def plan(sculler):
    """Without the table, which takes long."""
    own = oarlock.calibration.default_plan(sculler)
    return replace(own, steps=tuple(s for s in own.steps if s.kind != "turn"))


@pytest.fixture(scope="module")
def trial(sculler, plan):
    return oarlock.simulation.simulate_session(sculler, plan, ERRORS, seed=5, rate_hz=RATE_HZ)


@pytest.fixture(scope="module")
def recording(sculler, trial):
    """The session, then rowing with the same mounts."""
    motion = rowing.sculling(sculler, ROWED_S, 24, surge=False, seed=4)
    rowed = oarlock.simulate(sculler, motion, seed=4, rate_hz=RATE_HZ, calibration=trial.calibration)[1]
    shift_s = trial.recording.end_s + 1.0 / RATE_HZ - rowed.start_s
    streams = []
    for stream in rowed.streams:
        later = stream.at_rows(slice(None), stream.time_s + shift_s)
        if stream.name in trial.recording:
            first = trial.recording[stream.name]
            values = {n: np.concatenate([first.values[n], later.values[n]]) for n in first.values}
            later = replace(later, time_s=np.concatenate([first.time_s, later.time_s]), **values)
        streams.append(later)
    return oarlock.Recording(streams)


class Led:
    """A session whose commands are those of a guided start, and what came of it."""

    def __init__(self, model, trial, recording, folder):
        self.model, self.found, self.done = model, [], set()
        rig = rig_of(model, recording, wait_s=0.05)
        self.place = LiveFolder.create(folder, rig, None, START_NS, trial.plan)
        self.session, self.rows = LiveSession(rig, model, START_NS), StreamBuffer(rig)
        self.session.listeners.append(self.rows.add)
        self.recorder = Recorder(self.place.disk)
        moves = {s.name for s in trial.plan.steps if s.kind == "move"}
        self.plan = timed(
            trial.plan,
            {n: (round(a - REST_S * (n in moves), 3), round(b, 3)) for n, (a, b) in trial.spans.items()},
        )
        for packet in packets_of(recording):
            self._until((packet.arrival_ns - START_NS) / 1e9, trial.recording.end_s)
            self.take(packet)
        self.order(trial.recording.end_s + ROWED_S + 1.0, "stop")
        self.recorder.close()

    def _until(self, now_s, done_s):
        """The commands that are due: steps as they end, then the calibration, then the track."""
        for step in self.plan.steps:
            if now_s > step.end_s + 0.5 and step.name not in self.done:
                self.done.add(step.name)
                self.order(now_s, "step", name=step.name, begin_s=step.start_s, end_s=step.end_s)
        if self.session.calibration is None and now_s > done_s + 1.0:
            self.order(now_s, "step", name="N-pose", begin_s=0.1, end_s=0.2)
            self.order(now_s, "step", name="N-pose", begin_s=None, end_s=None)
            first = self.plan.steps[0]
            self.order(now_s, "step", name="N-pose", begin_s=first.start_s, end_s=first.end_s)
            parts = [
                self.rows.recording(from_s=s.start_s - PAD_S, to_s=s.end_s + PAD_S) for s in self.plan.steps
            ]
            self.verdict = judged(Task(1, self.model, self.plan, parts, None))
            self.order(now_s, "calibrate", toml=self.verdict.calibration)
        if self.session.tracker is None and now_s > done_s + BEFORE_TRACK_S:
            self.order(now_s, "track")

    def order(self, now_s, do, **keys):
        self.take(command(START_NS + int(1e9 * now_s), do, **keys))

    def take(self, packet):
        self.recorder.write(packet)
        self.found += self.session.take(packet)


@pytest.fixture(scope="module")
def led(sculler, trial, recording, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        with_test_format(patched)
        one = Led(sculler, trial, recording, tmp_path_factory.mktemp("guided"))
        ending = one.place.finish(sculler)
        one.recording = ending.recording
        assert not one.session.problems and not ending.damage and not ending.refused
        yield one


def test_offline_calibration_of_the_recording_gives_the_same(led, sculler):
    folder = led.place.path / RECORDING
    plan = oarlock.calibration.load_session_plan(folder / PLAN)
    assert plan == led.plan
    offline = oarlock.calibration.calibrate_session(sculler, oarlock.load_recording(folder), plan)
    live = oarlock.load_calibration(folder / CALIBRATION)
    assert live.noted == offline.noted
    for name, (rotation, _) in offline.mounts.items():
        np.testing.assert_array_equal(live.mounts[name][0], rotation)


def test_a_replay_of_the_packets_is_the_live_track_bit_for_bit(led, sculler):
    session = led.place.session(sculler)
    again = [one for packet in led.place.read() for one in session.take(packet)]
    assert len(again) == len(led.found) > 100
    for one, other in zip(again, led.found, strict=True):
        np.testing.assert_array_equal(one.belief.mean, other.belief.mean)
    np.testing.assert_array_equal(again[-1].belief.std, led.found[-1].belief.std)


def test_tracking_the_recording_with_its_calibration_is_the_live_track(led, sculler):
    calibration = oarlock.load_calibration(led.place.path / RECORDING / CALIBRATION)
    part = led.recording.slice(start_s=led.session.from_s)
    whole = oarlock.track(sculler, part, calibration=calibration, config=led.session.config)
    np.testing.assert_array_equal([one.time_s for one in led.found], whole.time_s)
    np.testing.assert_array_equal(led.found[-1].belief.mean, whole.last_belief.mean)


def test_a_calibration_that_is_none_changes_nothing(led, sculler):
    session = led.place.session(sculler)
    session.take(command(START_NS, "calibrate", toml="format = 1\nmounts = 3"))
    assert session.calibration is None and len(session.problems) == 1
    session.take(command(START_NS, "calibrate", toml=led.verdict.calibration))
    assert session.calibration.mounts.keys() == parsed_calibration(led.verdict.calibration).mounts.keys()
