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
    Heard,
    estimated,
    growth_percent,
    heard,
    is_last_estimate,
    repeated,
    tracked,
)
from oarlock_lab.soak.misbehaving import planted
from oarlock_lab.soak.watching import Watcher

MOST_GROWTH_PERCENT = 5.0
LEAST_FOR_MEMORY_S = 600.0
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
    words = [sys.executable, "-m", "bench.live.misbehaving", str(port), str(seconds), str(rate_hz)]
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
    command = [sys.executable, "-m", "bench.live.child", *words]
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
    found, errors = Soaked(), _errors(folder).read_text(encoding="utf-8")
    found.check(status == 0, f"the session ended with status {status}")
    found.check(not errors, f"the session wrote errors: {errors[-2000:]}")
    plan = planted(seconds)
    for where, events in (("log", read_events(folder)), ("page", watcher.events)):
        _check_events(found, where, heard(plan, events, offset_s))
    _check_memory(found, watcher, seconds)
    if status == 0:
        _check_estimates(found, folder, watcher)
    found.figures["frames that the viewer showed"] = watcher.frames
    found.figures["datagrams that the kernel dropped"] = [s["dropped"] for s in watcher.sources]
    return found


def _check_events(found: Soaked, where: str, told: Heard) -> None:
    found.figures[f"planted events in the {where}"] = f"{told.planted - len(told.missing)} of {told.planted}"
    found.figures[f"longest time until one was in the {where}, s"] = round(told.delay_s, 2)
    found.figures[f"other events in the {where}"] = len(told.others)
    missing = [(one.at_s, one.words) for one in told.missing]
    found.check(not missing, f"not in the {where}: {missing[:5]}")


def _check_memory(found: Soaked, watcher: Watcher, seconds: float) -> None:
    if seconds < LEAST_FOR_MEMORY_S or len(watcher.memory) < 20:
        return
    growth = growth_percent(watcher.memory)
    found.figures["memory at the end, MiB"] = round(watcher.memory[-1][1] / 1024)
    found.figures["growth of memory after the first fifth, %"] = round(growth, 2)
    found.check(growth <= MOST_GROWTH_PERCENT, f"the memory grew by {growth:.1f} %")


def _check_estimates(found: Soaked, folder: Path, watcher: Watcher) -> None:
    told, again = estimated(folder), repeated(folder).figures()
    found.figures["estimates"] = told["estimates"]
    found.figures["readings"] = watcher.arrivals
    same = again["digest"] == told["digest"]
    found.figures["all estimates from the recorded packets, bit for bit"] = same
    found.check(same, "the recorded packets give other estimates")
    batch = is_last_estimate(told, tracked(folder, told["from_s"]))
    found.figures["last estimate of the track of the recording, bit for bit"] = batch
    # What came more than half a second late is in the recording, and in no estimate.
    found.check(batch or watcher.arrivals.get("too_late", 0) > 0, "the track of the recording ends otherwise")


def summary(name: str, found: Soaked) -> str:
    """The figures and the problems as text."""
    lines = [f"{name}:", *(f"  {what}: {figure}" for what, figure in found.figures.items())]
    return "\n".join([*lines, *(f"  PROBLEM: {one}" for one in found.problems)])


def write(folder: Path, found: dict[str, Soaked]) -> None:
    """The figures for docs/live.md."""
    told = {name: {"figures": one.figures, "problems": one.problems} for name, one in found.items()}
    (folder / "soak.json").write_text(json.dumps(told, indent=2), encoding="utf-8")
