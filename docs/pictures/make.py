"""Makes the pictures of README and docs from the demo, through Chromium.

    python docs/pictures/make.py                 # runs the demo first
    python docs/pictures/make.py --demo out/demo # uses the folder of an earlier demo
    python docs/pictures/make.py --live          # only that of the live page

It needs playwright (`pip install playwright`) and a Chromium in the path.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
WIDE, PHONE = (1280, 900), (390, 844)
SOFTWARE_WEBGL = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
DRIVE_S = 20.6
"""A moment in the middle of a drive of the demo."""
PARTS = {
    "report-player.png": "#moving",
    "report-stroke.png": "#courses",
    "report-speeds.png": "#speeds",
    "report-hands.png": "#paths",
    "report-arms.png": "#arms",
}
"""Parts of the page by the picture that they become."""
CURVES_PX = 1040
"""Height of the picture of the curves: three rows."""
LIVE_S = 25.0
"""The live page has then run for a while."""


def main() -> None:
    """Writes the pictures beside this file."""
    asked = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    asked.add_argument("--demo", type=Path, help="folder of a demo; else one is run")
    asked.add_argument("--live", action="store_true", help="only the picture of the live page")
    given = asked.parse_args()
    if given.live:
        print(f"wrote {take_live()}")
        return
    folder = given.demo
    with tempfile.TemporaryDirectory() as spare:
        report = (folder or run_demo(Path(spare) / "demo")) / "sculler" / "smoother" / "report.html"
        for picture in take(report):
            print(f"wrote {picture}")


def run_demo(out: Path) -> Path:
    """The demo's folder."""
    subprocess.run([sys.executable, "-m", "oarlock", "demo", "--out", str(out)], check=True)
    return out


@contextmanager
def demo(out: Path) -> Iterator[str]:
    """The address of a live session with emulated sensors."""
    words = [sys.executable, "-u", "-m", "oarlock", "live", "demo", "--port", "0", "--out", str(out)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        try:
            yield next(line.strip() for line in running.stdout if line.startswith("http"))
        finally:
            running.terminate()


def take(report: Path) -> Iterator[Path]:
    """Pictures of the parts and of the first curves at a desk's width, and of the first screen of a telephone."""
    with chromium() as browser:
        page = opened(browser, report, WIDE)
        page.screenshot(path=HERE / "report-summary.png")
        yield HERE / "report-summary.png"
        for name, part in PARTS.items():
            page.evaluate(
                "part => document.querySelectorAll(`${part} details`).forEach(d => (d.open = true))", part
            )
            page.locator(part).screenshot(path=HERE / name)
            yield HERE / name
        page.evaluate("document.querySelectorAll('#measured details').forEach(d => (d.open = true))")
        page.evaluate("window.scrollTo(0, 0)")
        clip = {**page.locator("#curves").bounding_box(), "height": CURVES_PX}
        page.screenshot(path=HERE / "demo.png", full_page=True, clip=clip)
        yield HERE / "demo.png"
        page = opened(browser, report, PHONE)
        page.screenshot(path=HERE / "report-phone.png")
        yield HERE / "report-phone.png"


def take_live() -> Path:
    """The live page at a desk's width, when its curves are full and strokes are there."""
    with (
        tempfile.TemporaryDirectory() as spare,
        demo(Path(spare) / "session") as url,
        chromium() as browser,
    ):
        page = browser.new_page(viewport={"width": WIDE[0], "height": WIDE[1]}, color_scheme="light")
        page.goto(url)
        page.wait_for_timeout(1e3 * LIVE_S)
        page.screenshot(path=HERE / "live.png")
    return HERE / "live.png"


def opened(browser: Any, report: Path, size: tuple[int, int]) -> Any:
    """The report in a window of this size, its figure in the middle of a drive."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="light")
    page.goto(report.resolve().as_uri())
    page.wait_for_function("window.oarlock && window.oarlock.players.length > 0")
    page.evaluate(f"window.oarlock.players[0].seek({DRIVE_S})")
    page.wait_for_timeout(500)
    return page


@contextmanager
def chromium() -> Iterator[Any]:
    """A headless browser that draws space without a graphics card."""
    from playwright.sync_api import sync_playwright

    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        raise SystemExit("no chromium in the path (apt-get install chromium)")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE_WEBGL))
        yield browser
        browser.close()


if __name__ == "__main__":
    main()
