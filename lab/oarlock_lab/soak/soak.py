"""`make soak`: sessions of hours with devices that misbehave, one in true time and one without waiting."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from oarlock.live.event_log import read_events
from oarlock.live.folder import LiveFolder
from oarlock.live.transports.udp import free_port
from oarlock_lab.soak.checks import (
    EventsOfPlan,
    estimated,
    events_of_plan,
    growth_percent,
    is_last_estimate,
    repeated,
    tracked,
)
from oarlock_lab.soak.misbehaving import planted
from oarlock_lab.soak.watching import Watcher

MAX_GROWTH_PERCENT = 5.0
MIN_FOR_MEMORY_S = 600.0
"""In shorter runs nothing is said about memory: pools still fill."""


@dataclass
class Soaked:
    """What was measured, and what must not be.

    Args:
        figures: by name, as the summary prints them.
        problems: sentences; empty if all is well.
    """

    figures: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)

    def check(self, is_well: bool, problem: str) -> None:
        """Notes a problem."""
        if not is_well:
            self.problems.append(problem)


def soak_virtual(folder: Path, seconds: float, rate_hz: float) -> Soaked:
    """A session of so many seconds, without waiting."""
    words = [str(folder), str(rate_hz), "--virtual", str(seconds)]
    child, watcher = _started(words, folder)
    status = child.wait()
    watcher.join()
    return _checked(folder, seconds, 0.0, watcher, status)


def soak_live(folder: Path, seconds: float, rate_hz: float) -> Soaked:
    """A session of so many seconds in true time, over sockets."""
    port = free_port()
    child, watcher = _started([str(folder), str(rate_hz), str(port)], folder)
    words = [sys.executable, "-m", "oarlock_lab.soak.misbehaving", str(port), str(seconds), str(rate_hz)]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as sender:
        assert sender.stdout is not None
        begun_ns = int(sender.stdout.readline())
        sender.wait()
    time.sleep(2.0)
    child.send_signal(signal.SIGINT)
    status = child.wait()
    watcher.join()
    offset_s = (begun_ns - LiveFolder.load(folder).start_ns) / 1e9
    return _checked(folder, seconds, offset_s, watcher, status)


def _errors(folder: Path) -> Path:
    return folder.with_name(folder.name + ".errors")


def _started(words: list[str], folder: Path) -> tuple[subprocess.Popen[bytes], Watcher]:
    folder.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "oarlock_lab.soak.child", *words]
    errors: IO[bytes]
    with _errors(folder).open("wb") as errors:
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors)
    assert child.stdout is not None
    with child.stdout:
        url = child.stdout.readline().decode().strip()
    if not url:
        raise SystemExit(f"the session did not start: {_errors(folder).read_text(encoding='utf-8')}")
    return child, Watcher(url, child.pid)


def _checked(folder: Path, seconds: float, offset_s: float, watcher: Watcher, status: int) -> Soaked:
    soaked, errors = Soaked(), _errors(folder).read_text(encoding="utf-8")
    soaked.check(status == 0, f"the session ended with status {status}")
    soaked.check(not errors, f"the session wrote errors: {errors[-2000:]}")
    plan = planted(seconds)
    for where, events in (("log", read_events(folder)), ("page", watcher.events)):
        _check_events(soaked, where, events_of_plan(plan, events, offset_s))
    _check_memory(soaked, watcher, seconds)
    if status == 0:
        _check_estimates(soaked, folder, watcher)
    soaked.figures["frames that the viewer showed"] = watcher.frames
    soaked.figures["datagrams that the kernel dropped"] = [s["dropped"] for s in watcher.sources]
    return soaked


def _check_events(soaked: Soaked, where: str, reported: EventsOfPlan) -> None:
    soaked.figures[f"planted events in the {where}"] = (
        f"{reported.planted - len(reported.missing)} of {reported.planted}"
    )
    soaked.figures[f"longest time until one was in the {where}, s"] = round(reported.delay_s, 2)
    soaked.figures[f"other events in the {where}"] = len(reported.others)
    missing = [(fault.at_s, fault.words) for fault in reported.missing]
    soaked.check(not missing, f"not in the {where}: {missing[:5]}")


def _check_memory(soaked: Soaked, watcher: Watcher, seconds: float) -> None:
    if seconds < MIN_FOR_MEMORY_S or len(watcher.memory) < 20:
        return
    growth = growth_percent(watcher.memory)
    soaked.figures["memory at the end, MiB"] = round(watcher.memory[-1][1] / 1024)
    soaked.figures["growth of memory after the first fifth, %"] = round(growth, 2)
    soaked.check(growth <= MAX_GROWTH_PERCENT, f"the memory grew by {growth:.1f} %")


def _check_estimates(soaked: Soaked, folder: Path, watcher: Watcher) -> None:
    document, again = estimated(folder), repeated(folder).figures()
    soaked.figures["estimates"] = document["estimates"]
    soaked.figures["readings"] = watcher.arrivals
    same = again["digest"] == document["digest"]
    soaked.figures["all estimates from the recorded packets, bit for bit"] = same
    soaked.check(same, "the recorded packets give other estimates")
    batch = is_last_estimate(document, tracked(folder, document["from_s"]))
    soaked.figures["last estimate of the track of the recording, bit for bit"] = batch
    # What came more than half a second late is in the recording, and in no estimate.
    soaked.check(
        batch or watcher.arrivals.get("too_late", 0) > 0, "the track of the recording ends otherwise"
    )


def summary(name: str, soaked: Soaked) -> str:
    """The figures and the problems as text."""
    lines = [f"{name}:", *(f"  {quantity}: {figure}" for quantity, figure in soaked.figures.items())]
    return "\n".join([*lines, *(f"  PROBLEM: {soaked_run}" for soaked_run in soaked.problems)])


def write(folder: Path, soaked: dict[str, Soaked]) -> None:
    """The figures for docs/live.md."""
    document = {
        name: {"figures": soaked_run.figures, "problems": soaked_run.problems}
        for name, soaked_run in soaked.items()
    }
    (folder / "soak.json").write_text(json.dumps(document, indent=2), encoding="utf-8")
