"""Times Oarlock: steps compared with the textbook filter, latency of a live step, two threads."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from oarlock.lab.bench.problem import ESTIMATES, WARM, BenchProblem, Floats

FILTERS: Final = ("ukf", "ekf", "factorised")
BARE: Final = "bare_ukf"
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
    one_steps_s: float
    two_steps_s: float

    @property
    def ratio(self) -> float:
        """Speed with two threads relative to one."""
        return self.two_steps_s / self.one_steps_s


def race(problem: BenchProblem, estimate: str, seconds: float) -> Race:
    """Times every filter inside the engine; `estimate` is a key of `ESTIMATES`."""
    from oarlock import _core

    assert estimate in ESTIMATES
    configs = [*(problem.config(estimate, name) for name in FILTERS), problem.config(estimate, plain=True)]
    found = _core.race(problem.model, problem.recording, configs, WARM, seconds)
    filters = {name: StepTime.of(us) for name, us in zip((*FILTERS, BARE), found["steps_us"], strict=True)}
    return Race(found["n"], found["m"], filters, StepTime.of(found["textbook_us"]))


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
