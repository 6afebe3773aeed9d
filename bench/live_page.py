"""Measures in Chromium how long the live page takes from a message to the painted figure; `make bench-live`."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SIZES = {1280: (1280, 860), 390: (390, 844)}
WARM_S = 12.0
"""Until strokes are there, and the page has found what it can draw in time."""


def main() -> None:
    """Prints a line for each width of the page."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seconds", type=float, default=30.0)
    asked.add_argument("--viewers", type=int, default=1, help="programs beside the page that read all frames")
    asked.add_argument("--width", type=int, choices=SIZES, action="append")
    asked.add_argument("--big", action="store_true", help="with large numbers in place of the figure")
    given = asked.parse_args()
    print(
        "| width | viewers | frames/s | message to painted p50, p99 (ms) | reading to painted p50, p99 (ms) |"
    )
    print("|---|---|---|---|---|")
    for width in given.width or SIZES:
        with demo() as url:
            print(measured(url, width, given.seconds, given.viewers), flush=True)


@contextmanager
def demo() -> Iterator[str]:
    """The address of a session with emulated sensors."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "oarlock", "live", "demo", "--port", "0", "--out", f"{folder}/session"]
        running = subprocess.Popen(
            words, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
        )
        assert running.stdout is not None
        try:
            yield next(found[0] for line in running.stdout if (found := re.search(r"http://\S+", line)))
        finally:
            running.terminate()
            running.stdout.close()
            running.wait()


def measured(url: str, width: int, seconds: float, viewers: int) -> str:
    """A row of the table."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(SOFTWARE))
        size = dict(zip(("width", "height"), SIZES[width], strict=True))
        tabs = [browser.new_context(viewport=size).new_page() for _ in range(viewers)]
        for tab in tabs:
            tab.goto(url)
        time.sleep(WARM_S)
        tabs[0].evaluate("() => { oarlock.live.painted.length = 0; }")
        time.sleep(seconds)
        painted = tabs[0].evaluate("() => oarlock.live.painted")
        level = tabs[0].evaluate(
            "() => [oarlock.live.stage?.level, oarlock.live.stage?.drawer, oarlock.live.skipped]"
        )
        browser.close()
    print(level, len(painted), file=sys.stderr)
    waited, age = (np.array([one[key] for one in painted]) for key in ("waited_ms", "age_ms"))
    cells = [f"{np.percentile(values, 50):.0f}, {np.percentile(values, 99):.0f}" for values in (waited, age)]
    return f"| {width} px | {viewers} | {len(painted) / seconds:.0f} | {cells[0]} | {cells[1]} |"


if __name__ == "__main__":
    main()
