"""`make bench-live`: how long a reading takes to an estimate, and the estimate to the painted figure in Chromium.

`python -m oarlock_lab.soak.latency --page FILE` puts the table of the last run into a page, between its two marks.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from oarlock.evaluation.comparison.comparison import processor
from oarlock.live.transports.udp import free_port
from oarlock.storage.arrays import Floats
from oarlock_lab.pages.sections import into_page, table
from oarlock_lab.soak.child import FIGURES

OUT = Path("out/bench-live")
MARKS = "latency"
SIZES = {1280: (1280, 860), 390: (390, 844)}
FLAGS = ("--no-sandbox",)
"""Chromium as it starts where there is no graphics card."""
WARM_S = 12.0
"""Until clocks have settled, strokes are there, and the page has found what it can draw in time."""
COLUMNS = (
    *("page", "load", "packet in to estimate out p50, p99 (ms)", "wait for the order p50, p99 (ms)"),
    *("processor time an estimate (ms)", "frames/s", "estimate to painted p50, p99 (ms)"),
    *("readings; lost; dropped by the kernel",),
)


@dataclass(frozen=True)
class LatencyRun:
    """One run.

    Args:
        page: width, px; None without a browser.
        load: of the machine, mean of the last minute.
        figures: of the session, as `oarlock_lab.soak.timed` writes it.
        painted: frames that the page painted: `time_s`, `age_ms`.
        seconds: of the measurement.
    """

    page: int | None
    load: float
    figures: dict[str, Any]
    painted: list[dict[str, float]]
    seconds: float

    @property
    def rows(self) -> Floats:
        """Moment, arrival, time out and processor time of the estimates after warming, s."""
        rows: Floats = np.array(self.figures["rows"])
        return np.asarray(rows[rows[:, 2] > rows[-1, 2] - self.seconds])

    def cells(self) -> list[str]:
        """A row of the table."""
        rows = self.rows
        spent_ms = 1e3 * (rows[-1, 3] - rows[0, 3]) / (len(rows) - 1)
        figures, painted_ms = self.figures, self.painted_ms()
        return [
            "none" if self.page is None else f"{self.page} px",
            f"{self.load:.1f}",
            _two(1e3 * (rows[:, 2] - rows[:, 1])),
            _two(1e3 * (rows[:, 1] - rows[:, 0])),
            f"{spent_ms:.1f}",
            f"{len(painted_ms) / self.seconds:.0f}" if self.page else "",
            _two(painted_ms),
            f"{figures['readings']:,}; {figures['lost']}; {figures['dropped']}",
        ]

    def painted_ms(self) -> np.ndarray:
        """From the estimate to its painted figure, by the session's clock."""
        out = {row[0]: (row[1], row[2]) for row in self.figures["rows"]}
        estimated = [picture for picture in self.painted if picture["time_s"] in out]
        return np.array(
            [picture["age_ms"] - 1e3 * np.subtract(*out[picture["time_s"]][::-1]) for picture in estimated]
        )


def _two(values: np.ndarray) -> str:
    """Median and 99 % quantile."""
    return ", ".join(f"{np.percentile(values, q):.1f}" for q in (50, 99)) if len(values) else ""


@contextmanager
def session(folder: Path) -> Iterator[str]:
    """The address of a session with emulated sensors; its figures are in the folder when it has ended."""
    port = str(free_port())
    with subprocess.Popen(
        [sys.executable, "-m", "oarlock_lab.soak.timed", "--send", port], stdout=subprocess.PIPE, text=True
    ) as sender:
        assert sender.stdout is not None
        sender.stdout.readline()
        words = [sys.executable, "-m", "oarlock_lab.soak.timed", str(folder), port]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as running:
            assert running.stdout is not None
            try:
                yield next(
                    figures[0] for line in running.stdout if (figures := re.search(r"http://\S+", line))
                )
            finally:
                running.send_signal(signal.SIGINT)
                running.wait()
                sender.terminate()


def measured(page: int | None, seconds: float) -> LatencyRun:
    """One run, with a page of this width or without a browser."""
    with tempfile.TemporaryDirectory() as place:
        folder, painted = Path(place) / "session", list[dict[str, float]]()
        with session(folder) as url:
            if page is None:
                time.sleep(WARM_S + seconds)
            else:
                painted = _painted(url, page, seconds)
            load = os.getloadavg()[0]
        figures = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    return LatencyRun(page, load, figures, painted, seconds)


def _painted(url: str, page: int, seconds: float) -> list[dict[str, float]]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        width, height = SIZES[page]
        tab = browser.new_context(viewport={"width": width, "height": height}).new_page()
        tab.goto(url)
        time.sleep(WARM_S)
        tab.evaluate("() => { oarlock.live.painted.length = 0; }")
        time.sleep(seconds)
        figures: list[dict[str, float]] = tab.evaluate("() => oarlock.live.painted")
        browser.close()
    return figures


def written(runs: list[LatencyRun]) -> str:
    """The table with date, commit and machine."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    text = (
        f"Measured on {time.strftime('%d %b %Y')}, commit {commit}, {processor()}, {os.cpu_count()} cores, Chromium\n"
        "without a graphics card. Five units and five encoders at 100 Hz; sender, session and browser share the cores."
    )
    return f"{text}\n\n{table(COLUMNS, [run.cells() for run in runs])}\n"


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(prog="python -m oarlock_lab.soak.latency", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each measurement")
    parser.add_argument("--runs", type=int, default=1, help="of so many the one with the least load counts")
    parser.add_argument("--page", type=Path, help="only put the last run's table into this page")
    arguments = parser.parse_args()
    if arguments.page is not None:
        figures = (OUT / "table.md").read_text(encoding="utf-8")
        page = arguments.page.read_text(encoding="utf-8")
        arguments.page.write_text(into_page(page, figures, MARKS), encoding="utf-8")
        return
    best = []
    for width in (None, *SIZES):
        runs = [measured(width, arguments.seconds) for _ in range(arguments.runs)]
        for run in runs:
            print(*run.cells(), sep=" | ", file=sys.stderr)
        best.append(min(runs, key=lambda run: run.load))
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "table.md").write_text(written(best), encoding="utf-8")
    print(written(best))


if __name__ == "__main__":
    main()
