"""Times installed other software on the same readings, and lists what is not installed, for `oarlock bench`.

Each runs in a process of its own and on one core, as Oarlock's filter does: libraries that share small products
among threads lose by it, and more so on a busy machine.
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

from oarlock.lab.bench import with_biorbd, with_filterpy, with_jax, with_numpy
from oarlock.lab.bench.problem import Floats, Problem, sculling

Run = Callable[[], Floats]
"""A run over the samples behind the warm ones: estimates, (steps, states). The same again each time."""

SAME = "the same filter on the same readings"
SMALLER = "a far smaller problem: 11 angles from 5 orientations that another filter must find first"
INSTALL = "pip install 'oarlock[bench]'"


@dataclass(frozen=True)
class Software:
    """Other software to compare with: its name, package, problem and setup."""

    name: str
    package: str
    problem: str
    make: Callable[[Problem], Run]

    def installed(self) -> str | None:
        """The package's version; None where it is missing."""
        if importlib.util.find_spec(self.package) is None:
            return None
        try:
            return version(self.package)
        except PackageNotFoundError:
            return "of unknown version"


@dataclass(frozen=True)
class Figure:
    """What other software reached."""

    name: str
    package: str
    version: str
    steps_s: float
    problem: str


@dataclass(frozen=True)
class Failure:
    """Other software that is installed and does not run."""

    name: str
    package: str
    version: str
    reason: str


SOFTWARE = (
    Software("UKF in NumPy, all points at once", "numpy", SAME, with_numpy.make),
    Software("UKF in JAX, jit and scan", "jax", SAME, with_jax.make),
    Software("filterpy, readings of NumPy", "filterpy", SAME, with_filterpy.make),
    Software("biorbd's Kalman filter", "biorbd", SMALLER, with_biorbd.make),
)


def missing() -> list[Software]:
    """What is not installed here."""
    return [software for software in SOFTWARE if software.installed() is None]


ONE_CORE = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}


def time_other(software: Software, seconds: float) -> Figure | Failure:
    """Times it for `seconds`, and a few more to start and to compile."""
    command = [sys.executable, "-m", "oarlock.lab.bench.others", software.package, str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **ONE_CORE})
    installed = software.installed() or ""
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return Failure(software.name, software.package, installed, last)
    steps_s = json.loads(done.stdout.splitlines()[-1])
    return Figure(software.name, software.package, installed, steps_s, software.problem)


def steps_per_second(run: Run, seconds: float) -> float:
    """Runs once to warm up (JAX compiles), then for `seconds`, and once at least; the median run counts."""
    run()
    spent: list[float] = []
    begun = time.perf_counter()
    while not spent or time.perf_counter() - begun < seconds:
        before = time.perf_counter()
        count = len(run())
        spent.append((time.perf_counter() - before) / count)
    return 1.0 / float(np.median(spent))


def _main(package: str, seconds: float) -> None:
    (software,) = (one for one in SOFTWARE if one.package == package)
    print(json.dumps(steps_per_second(software.make(sculling()), seconds)))


if __name__ == "__main__":
    _main(sys.argv[1], float(sys.argv[2]))
