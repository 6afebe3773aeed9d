"""Times what users run: whole recordings tracked and smoothed, and a person with sixteen units, for `oarlock bench`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from oarlock.lab.bench.problem import BenchProblem

BODY: Final = "full_body"
START_S: Final = 30.0
"""The start of a body without magnetometers, in which up to twelve hypotheses run, s."""
BODY_RATE_HZ: Final = 100.0


@dataclass(frozen=True)
class Whole:
    """Processor time of a sample of a whole recording, µs: tracked, and one smoothing pass after that."""

    track_us: float
    smooth_us: float


@dataclass(frozen=True)
class FullBody:
    """A person with sixteen units without magnetometers, tracked live; a simulated calibration session.

    Args:
        n: states.
        units: inertial units.
        step_us: processor time of a step behind the start, by then of one hypothesis, median, µs.
        start_us: the same over the first `START_S`, mean over all hypotheses that run, µs.
    """

    n: int
    units: int
    step_us: float
    start_us: float

    @property
    def times_real_time(self) -> float:
        """How often the steps of one hypothesis fit into the time between samples."""
        return 1e6 / (BODY_RATE_HZ * self.step_us)

    @property
    def start_times_real_time(self) -> float:
        """The same for the start."""
        return 1e6 / (BODY_RATE_HZ * self.start_us)


def whole(problem: BenchProblem, estimate: str, seconds: float) -> Whole:
    """Tracks and smooths the recording for about `seconds`; the least time of each counts."""
    from oarlock import smooth, track

    config, samples = problem.config(estimate), len(problem.time_s)
    tracked, smoothed, begun = list[float](), list[float](), time.perf_counter()
    while not tracked or time.perf_counter() - begun < seconds:
        before = time.thread_time()
        live = track(problem.model, problem.recording, config=config)
        between = time.thread_time()
        smooth(live)
        tracked.append(between - before)
        smoothed.append(time.thread_time() - between)
    return Whole(1e6 * min(tracked) / samples, 1e6 * min(smoothed) / samples)


def full_body(seconds: float) -> FullBody:
    """Steps a tracker through a session of the shipped `"full_body"`; 40 s of it where there is time, at least 2 s."""
    from oarlock import Calibration, Tracker, load_model
    from oarlock.simulation.session import simulate_session

    model = load_model(BODY)
    session = simulate_session(model, seed=1, rate_hz=BODY_RATE_HZ)
    tracker = Tracker(model, Calibration(mounts=session.calibration.mounts))
    duration_s = min(max(2.0, 8.0 * seconds), 40.0)
    samples = tracker.samples(session.recording)[: int(duration_s * BODY_RATE_HZ)]
    spent_s = []
    for sample in samples:
        before = time.thread_time()
        tracker.step(sample)
        spent_s.append(time.thread_time() - before)
    us, belief = 1e6 * np.array(spent_s), tracker.belief
    if belief is None:
        raise RuntimeError(f"no start was found within {duration_s:g} s")
    # In a short run the start is its first half.
    begun = min(int(START_S * BODY_RATE_HZ), len(us) // 2)
    return FullBody(
        len(belief.mean),
        len(session.recording.streams),
        float(np.median(us[begun:])),
        float(us[:begun].mean()),
    )
