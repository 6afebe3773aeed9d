"""Times installed other software on the same readings, and lists what is not installed, for `oarlock lab bench`.

Each runs in a separate process and on one core, like Oarlock's filter: libraries that divide small matrix products
among threads become slower, especially on a busy machine.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock_lab.bench import with_biorbd
from oarlock_lab.bench.problem import BenchProblem, sculling
from oarlock_lab.bench.unscented import filterpy_run, jax_run, numpy_run

Run = Callable[[], Floats]
"""A run over the samples after the warm-up: estimates, (steps, states). Every run gives the same result."""

SAME = "the same filter on the same readings"
SMALLER = "a far smaller problem: 11 angles from 5 orientations that another filter must find first"
INSTALL = "pip install 'oarlock-lab[bench]'"


@dataclass(frozen=True)
class Software:
    """Other software to compare with: its name, package, problem and setup."""

    name: str
    package: str
    problem: str
    make: Callable[[BenchProblem], Run]

    def installed(self) -> str | None:
        """The package's version; None where it is missing."""
        if importlib.util.find_spec(self.package) is None:
            return None
        try:
            return version(self.package)
        except PackageNotFoundError:
            return "of unknown version"


@dataclass(frozen=True)
class SoftwareTiming:
    """Result of other software."""

    name: str
    package: str
    version: str
    steps_s: float
    problem: str


@dataclass(frozen=True)
class Failure:
    """Other software that is installed but does not run."""

    name: str
    package: str
    version: str
    reason: str


SOFTWARE = (
    Software("UKF in NumPy, all points at once", "numpy", SAME, numpy_run),
    Software("UKF in JAX, jit and scan", "jax", SAME, jax_run),
    Software("filterpy, readings of NumPy", "filterpy", SAME, filterpy_run),
    Software("biorbd's Kalman filter", "biorbd", SMALLER, with_biorbd.make),
)


def missing() -> list[Software]:
    """Other software that is not installed."""
    return [software for software in SOFTWARE if software.installed() is None]


SINGLE_CORE = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}


def time_other(software: Software, seconds: float) -> SoftwareTiming | Failure:
    """Times one software for `seconds`; starting and compiling take a few seconds more."""
    command = [sys.executable, "-m", "oarlock_lab.bench.others", software.package, str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **SINGLE_CORE})
    installed = software.installed() or ""
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return Failure(software.name, software.package, installed, last)
    steps_s = json.loads(done.stdout.splitlines()[-1])
    return SoftwareTiming(software.name, software.package, installed, steps_s, software.problem)


def steps_per_second(run: Run, seconds: float) -> float:
    """Runs once to warm up (JAX compiles), then at least once and for `seconds`; the result is the median run."""
    run()
    spent: list[float] = []
    begun = time.perf_counter()
    while not spent or time.perf_counter() - begun < seconds:
        before = time.perf_counter()
        count = len(run())
        spent.append((time.perf_counter() - before) / count)
    return 1.0 / float(np.median(spent))


def _main(package: str, seconds: float) -> None:
    (software,) = (candidate for candidate in SOFTWARE if candidate.package == package)
    print(json.dumps(steps_per_second(software.make(sculling()), seconds)))


if __name__ == "__main__":
    _main(sys.argv[1], float(sys.argv[2]))
