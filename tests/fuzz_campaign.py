"""Runs a property on many examples: some hundred by default, for OARLOCK_FUZZ_SECONDS each where that is set."""

import faulthandler
import itertools
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from oarlock.storage.errors import DataError, ModelError

EXAMPLES = 25
EXAMPLES_A_ROUND = 100
# Of the processor: the slowest of an hour take about two seconds, which a crowded machine may spread over minutes.
HANG_S = 20
SILENT_S = 600
# More than the process has: a file of some kilobytes that asks for gigabytes is a fault.
MOST_BYTES = 2 << 30
Answer = TypeVar("Answer")

_SETTINGS = settings(
    deadline=None,
    database=None,
    phases=[Phase.generate, Phase.shrink],
    suppress_health_check=list(HealthCheck),
    print_blob=True,
)


def campaign(
    check: Callable[..., None],
    *strategies: SearchStrategy[Any],
    long_only: bool = False,
    count: int = EXAMPLES,
) -> None:
    """Check examples of the strategies; a fixed number of fixed ones unless the environment sets a time.

    Args:
        check: what shall hold of each example.
        strategies: make its arguments.
        long_only: where other people's compiled readers are fed, which may end the process: `make fuzz` alone does it.
        count: how many examples, unless the environment sets a time; fewer where each starts processes.
    """
    limit = os.environ.get("OARLOCK_FUZZ_SECONDS")
    if long_only and limit is None:
        pytest.skip("fed with rubbish by `make fuzz` alone")

    def watched(values: tuple[Any, ...]) -> None:
        with ended_if_it_hangs():
            check(*values)

    examples = given(st.tuples(*strategies))

    if limit is None:
        settings(_SETTINGS, max_examples=count, derandomize=True)(examples(watched))()
        return
    first = int(os.environ.get("OARLOCK_FUZZ_SEED", "0"))
    end = time.monotonic() + float(limit)
    for number in itertools.count(first):
        if time.monotonic() >= end:
            break
        test = settings(_SETTINGS, max_examples=EXAMPLES_A_ROUND)(examples(watched))
        seed(number)(test)()
    print(f"fuzz {check.__name__}: {number - first} rounds of {EXAMPLES_A_ROUND}", file=sys.stderr)


def answered(call: Callable[[], Answer], also: tuple[type[Exception], ...] = ()) -> Answer | None:
    """The result, or None after a refusal that says something; whatever else is raised is a fault."""
    try:
        return call()
    except (DataError, ModelError, *also) as refusal:
        assert len(str(refusal).strip()) > 10, f"{type(refusal).__name__} says nothing: {refusal}"
    except BaseException as fault:
        # The engine's panics are no Exception, and would end the run without the example.
        if type(fault).__name__ != "PanicException":
            raise
        raise AssertionError(f"the engine panicked: {fault}") from fault
    return None


@contextmanager
def ended_if_it_hangs() -> Iterator[None]:
    """Raise where Python hangs, end the process where compiled code does."""

    def hung(*_: object) -> None:
        raise AssertionError(f"no answer within {HANG_S} s of the processor")

    limits = resource.getrlimit(resource.RLIMIT_AS)
    own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (own + MOST_BYTES, limits[1]))
    before = signal.signal(signal.SIGPROF, hung)
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    faulthandler.dump_traceback_later(SILENT_S, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_AS, limits)
