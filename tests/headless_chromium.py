"""Debian's Chromium without a window and without a network, for tests of pages."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium")
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
HANGS_MS = 900_000
"""A guard against pages that never answer: hundreds of times what one takes, since a busy machine is no fault of it."""

Opened = Callable[..., Any]


@contextmanager
def driver_of_chromium(not_tried: str) -> Iterator[Any]:
    """Playwright's own; where it or Chromium is missing, the test is skipped and says so."""
    sync_api = pytest.importorskip("playwright.sync_api", reason=f"{not_tried}: pip install playwright")
    if CHROMIUM is None:
        pytest.skip(f"{not_tried}: no chromium here (apt-get install chromium)")
    with sync_api.sync_playwright() as playwright:
        yield playwright.chromium


@contextmanager
def chromium(not_tried: str) -> Iterator[Any]:
    """A browser that draws in software."""
    with driver_of_chromium(not_tried) as driver:
        launched = driver.launch(executable_path=CHROMIUM, args=SOFTWARE, timeout=HANGS_MS)
        yield launched
        launched.close()


def serious_violations(tab: Any) -> list[str]:
    """What axe finds serious or critical, with every part folded and then unfolded."""
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="pip install axe-playwright-python"
    )
    found = []
    for unfolded in ("false", "true"):
        tab.evaluate(f"document.querySelectorAll('details').forEach(part => {{ part.open = {unfolded}; }})")
        violations = axe.Axe().run(tab).response["violations"]
        found += [one["id"] for one in violations if one["impact"] in ("serious", "critical")]
    return found


@contextmanager
def quiet_tabs(browser: Any, expected: tuple[str, ...]) -> Iterator[Opened]:
    """Opens files without a network; whatever else than `expected` the console says fails the test."""
    contexts, complaints = [], []

    def open_(file: Path, width: int = 1280, height: int = 900, **settings: Any) -> Any:
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True, **settings)
        contexts.append(context)
        tab = context.new_page()
        tab.set_default_timeout(HANGS_MS)
        tab.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("request", lambda r: r.url.startswith("http") and complaints.append(f"asked for {r.url}"))
        tab.goto(file.as_uri())
        return tab

    yield open_
    for context in contexts:
        context.close()
    loud = [text for text in complaints if not any(sign in text for sign in expected)]
    assert not loud, loud
