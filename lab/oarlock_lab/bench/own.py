"""Times Oarlock: steps compared with the textbook filter, a live step, two threads, whole recordings, a full body."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock_lab.bench.problem import ESTIMATES, WARM, BenchProblem

FILTERS: Final = ("ukf", "ekf", "factorised")
PLAIN: Final = "bare_ukf"
"""The `ukf` without gates: only what the textbook filter does too."""


@dataclass(frozen=True)
class StepTime:
    """Time of one filter's step, in µs: median and 10 % quantile."""

    us: float
    us_p10: float

    @classmethod
    def of(cls, times_us: Floats) -> StepTime:
        """The quantiles of the times of many steps."""
        half, tenth = np.quantile(times_us, [0.5, 0.1])
        return cls(float(half), float(tenth))


@dataclass(frozen=True)
class Race:
    """Times of Oarlock's filters and of the textbook filter, measured in turn: n states, m readings."""

    n: int
    m: int
    filters: dict[str, StepTime]
    textbook: StepTime

    def ratio(self, filter_name: str) -> float:
        """Time of the textbook filter divided by that of this filter; medians."""
        return self.textbook.us / self.filters[filter_name].us

    def ratio_p10(self, filter_name: str) -> float:
        """The same for the 10 % quantiles, which other processes disturb less."""
        return self.textbook.us_p10 / self.filters[filter_name].us_p10


@dataclass(frozen=True)
class Latency:
    """Latency of `Tracker.step`, called from Python for one sample after the other, µs."""

    p50_us: float
    p99_us: float
    p99_9_us: float
    steps: int


@dataclass(frozen=True)
class Threads:
    """Samples per second by `track_many`, with the same number of recordings for each thread."""

    cores: int
    single_steps_s: float
    two_steps_s: float

    @property
    def ratio(self) -> float:
        """Speed with two threads relative to one."""
        return self.two_steps_s / self.single_steps_s


def race(problem: BenchProblem, estimate: str, seconds: float) -> Race:
    """Times every filter inside the engine; `estimate` is a key of `ESTIMATES`."""
    from oarlock import _core

    assert estimate in ESTIMATES
    configs = [*(problem.config(estimate, name) for name in FILTERS), problem.config(estimate, plain=True)]
    rates = _core.race(problem.model, problem.recording, configs, WARM, seconds)
    filters = {name: StepTime.of(us) for name, us in zip((*FILTERS, PLAIN), rates["steps_us"], strict=True)}
    return Race(rates["n"], rates["m"], filters, StepTime.of(rates["textbook_us"]))


def live(problem: BenchProblem, estimate: str, seconds: float) -> Latency:
    """Times `Tracker.step` from Python with the default filter, including state estimate and report."""
    from oarlock import Tracker

    config = problem.config(estimate)
    first = Tracker(problem.model, None, config)
    samples = first.samples(problem.recording)
    for sample in samples[:WARM]:
        first.step(sample)
    start, times_us = first.belief, list[float]()
    begun = time.perf_counter()
    while not times_us or time.perf_counter() - begun < seconds:
        times_us += _live_steps(Tracker(problem.model, None, config, start), samples[WARM:])
    p50, p99, p99_9 = (float(q) for q in np.quantile(times_us, [0.5, 0.99, 0.999]))
    return Latency(p50, p99, p99_9, len(times_us))


def _live_steps(tracker, samples: Iterable[object]) -> list[float]:  # type: ignore[no-untyped-def]
    step, clock, spent = tracker.step, time.perf_counter_ns, []
    for sample in samples:
        before = clock()
        step(sample)
        spent.append(1e-3 * (clock() - before))
    return spent


def threads(problem: BenchProblem, seconds: float) -> Threads:
    """Times `track_many` on one thread and on two, in turn; the best round of each is used."""
    from oarlock import track_many

    config = problem.config("with_biases")
    recordings = [problem.recording] * 2
    steps = len(problem.time_s) * len(recordings)
    best, begun = {1: 0.0, 2: 0.0}, time.perf_counter()
    while not best[2] or time.perf_counter() - begun < seconds:
        for count in best:
            before = time.perf_counter()
            track_many(problem.model, recordings, config=config, threads=count)
            best[count] = max(best[count], steps / (time.perf_counter() - before))
    return Threads(
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        best[1],
        best[2],
    )


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
