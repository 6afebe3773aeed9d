"""What is followed in the estimates is worked on with the calibration that serves: a guided start replaces it."""

import asyncio
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from senders import START_NS, rig_of

import oarlock
from oarlock import rowing
from oarlock.live.live import Live
from oarlock.live.session import LiveSession, command
from oarlock.recording.calibration import calibration_text


class Repeats:
    """A follower whose messages say with which calibration they were made."""

    def work(self, task, calibration):
        return {"type": "stroke", "time_s": task, "calibration": calibration}

    def step(self, time_s, belief):
        return time_s


class Told:
    def __init__(self):
        self.messages = []

    def announce(self, message):
        self.messages.append(message)

    def publish(self, message):
        pass


@pytest.fixture(scope="module")
def recording(sculler):
    return oarlock.simulate(sculler, rowing.sculling(sculler, 1.0, 24, seed=1), seed=1, rate_hz=50)[1]


def test_after_a_guided_start_strokes_have_its_calibration(sculler, recording, tmp_path):
    """The command is the one that a guided start gives."""
    at_start = oarlock.Calibration(parameters={"r_upperarm_length": 0.30})
    found = oarlock.Calibration(parameters={"r_upperarm_length": 0.33})
    rig, follower, told = rig_of(sculler, recording), Repeats(), Told()
    live = Live(rig, sculler, tmp_path / "today", at_start, follower=follower, server=told)
    live.session = LiveSession(rig, sculler, START_NS, at_start)

    async def followed():
        with ThreadPoolExecutor(1) as pool:
            live._pool, live._followed = pool, 0
            await live._work(follower, 1.0)
            live.session.take(command(time.monotonic_ns(), "calibrate", toml=calibration_text(found)))
            await live._work(follower, 2.0)

    asyncio.run(followed())
    assert not live.session.problems
    assert [one["calibration"].parameters["r_upperarm_length"] for one in told.messages] == [0.30, 0.33]
    assert [one["number"] for one in told.messages] == [1, 2]


def test_a_stroke_is_computed_with_the_calibration_given(sculler, monkeypatch):
    """`StrokeFollower` keeps none of its own."""
    given = []
    module = "oarlock.rowing.report.live.live_stroke"
    monkeypatch.setattr(
        module, lambda stretch, model, calibration: given.append((stretch, model, calibration))
    )
    calibration = oarlock.Calibration(parameters={"r_upperarm_length": 0.33})
    assert rowing.StrokeFollower(sculler).work("stretch", calibration) is None
    assert given == [("stretch", sculler, calibration)]
