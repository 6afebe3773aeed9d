"""Runs all measurements of `oarlock lab bench` and collects the results, with the paper's figure."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, Final

from oarlock.evaluation.comparison.comparison import processor
from oarlock.rowing.simulation.paper import STEPS_PER_S
from oarlock_lab.bench.others import INSTALL, SOFTWARE, Failure, Software, SoftwareTiming, missing, time_other
from oarlock_lab.bench.own import (
    FullBody,
    Latency,
    Race,
    Threads,
    Whole,
    full_body,
    live,
    race,
    threads,
    whole,
)
from oarlock_lab.bench.problem import RATE_HZ, sculling


@dataclass(frozen=True)
class Printed:
    """A published figure."""

    steps_s: float
    n: int
    m: int
    machine: str
    program: str


PAPER: Final = Printed(STEPS_PER_S, 37, 58, "Intel Core i7 M620, 2.66 GHz", "C generated from Simulink")
"""The source's own figure (Ruffaldi, Peppoloni and Filippeschi, section 5)."""

REFERENCE_TEXTBOOK_US: Final = 405.0
"""Time of a step of the textbook filter at 41 states on one core of a 3.7 GHz Zen 4, microseconds."""

# shares of the given time
_RACE, _RACE_WITH_BIASES, _LIVE, _WHOLE, _BODY, _THREADS, _OTHER = 0.15, 0.15, 0.1, 0.1, 0.25, 0.1, 0.15

Progress = Callable[[str], AbstractContextManager[object]]


@dataclass(frozen=True)
class Bench:
    """Results of all measurements."""

    joints: Race
    with_biases: Race
    latency: Latency
    latency_with_biases: Latency
    whole: Whole
    whole_with_biases: Whole
    body: FullBody
    threads: Threads
    others: tuple[SoftwareTiming, ...]
    failed: tuple[Failure, ...]
    missing: tuple[Software, ...]

    def to_dict(self) -> dict[str, Any]:
        """All figures by name; those with biases are under `with_biases`."""
        times_real_time = 1e6 / self.joints.filters["ukf"].us / RATE_HZ
        return {
            **_figures(self.joints, self.latency, self.whole),
            "times_real_time": times_real_time,
            "rate_hz": RATE_HZ,
            "with_biases": _figures(self.with_biases, self.latency_with_biases, self.whole_with_biases),
            "full_body": {
                **vars(self.body),
                "times_real_time": self.body.times_real_time,
                "start_times_real_time": self.body.start_times_real_time,
            },
            "one_thread_steps_s": self.threads.single_steps_s,
            "two_threads_steps_s": self.threads.two_steps_s,
            "two_threads_ratio": self.threads.ratio,
            "cores": self.threads.cores,
            "usual_textbook_us": REFERENCE_TEXTBOOK_US,
            "paper": vars(PAPER),
            "others": [vars(figure) for figure in self.others],
            "failed": [vars(failure) for failure in self.failed],
            "missing": [software.package for software in self.missing],
            "install": INSTALL if self.missing else None,
            "machine": machine(),
        }


def _figures(timed: Race, latency: Latency, whole: Whole) -> dict[str, Any]:
    figures: dict[str, Any] = {"n": timed.n, "m": timed.m, **vars(whole)}
    for name, step in timed.filters.items():
        figures |= {
            f"{name}_steps_s": 1e6 / step.us,
            f"{name}_us": step.us,
            f"{name}_us_p10": step.us_p10,
            f"{name}_ratio_to_textbook": timed.ratio(name),
            f"{name}_ratio_to_textbook_p10": timed.ratio_p10(name),
        }
    figures |= {"textbook_us": timed.textbook.us, "textbook_us_p10": timed.textbook.us_p10}
    return figures | {
        "p50_us": latency.p50_us,
        "p99_us": latency.p99_us,
        "p99_9_us": latency.p99_9_us,
        "live_steps": latency.steps,
    }


def machine() -> dict[str, str]:
    """Description of the machine."""
    from oarlock import __version__

    return {
        "processor": processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "oarlock": __version__,
    }


def measure(seconds: float, progress: Progress = lambda text: nullcontext()) -> Bench:
    """Measures for about `seconds`, and a few more where other software compiles or is slow.

    Args:
        seconds: time for all measurements together.
        progress: returns a context manager for each part, to show progress.
    """
    with progress("simulating"):
        problem = sculling()
    with progress("comparing with the textbook filter"):
        joints = race(problem, "joints", _RACE * seconds)
        with_biases = race(problem, "with_biases", _RACE_WITH_BIASES * seconds)
    with progress("stepping live"):
        lone, biased = (live(problem, name, _LIVE / 2 * seconds) for name in ("joints", "with_biases"))
    with progress("tracking and smoothing whole recordings"):
        all_of, all_biased = (
            whole(problem, name, _WHOLE / 2 * seconds) for name in ("joints", "with_biases")
        )
    with progress("tracking a full body"):
        body = full_body(_BODY * seconds)
    with progress("tracking on two threads"):
        many = threads(problem, _THREADS * seconds)
    others = tuple(_others(seconds, progress))
    figures = tuple(other for other in others if isinstance(other, SoftwareTiming))
    failed = tuple(other for other in others if isinstance(other, Failure))
    return Bench(
        joints, with_biases, lone, biased, all_of, all_biased, body, many, figures, failed, tuple(missing())
    )


def _others(seconds: float, progress: Progress) -> Iterator[SoftwareTiming | Failure]:
    installed = [software for software in SOFTWARE if software.installed()]
    for software in installed:
        with progress(software.name):
            yield time_other(software, _OTHER / len(installed) * seconds)
