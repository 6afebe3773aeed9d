"""Tabs of the live page in a browser: whatever the console says fails the test, as does a request to elsewhere."""

from __future__ import annotations

import time
from contextlib import contextmanager

from headless_chromium import HANGS_MS

GPU_STALL = "GPU stall"
"""Software WebGL says how slowly it reads pixels back."""


@contextmanager
def opened(browser, session, size=(1280, 860), expected=(), script="", **settings):
    """A tab of the page, which shows frames."""
    complaints: list[str] = []
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **settings)
    tab = context.new_page()
    tab.add_init_script(script)
    tab.set_default_timeout(HANGS_MS)
    tab.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    home = session.url.partition("?")[0]
    tab.on(
        "request",
        lambda r: r.url.startswith((home, "data:")) or complaints.append(f"asked for {r.url}"),
    )
    tab.goto(session.url)
    until(tab, "(oarlock.live?.frames ?? 0) > 3")
    yield tab
    context.close()
    assert not [text for text in complaints if not any(sign in text for sign in (GPU_STALL, *expected))]


def until(tab, code):
    """Waits for an expression of the page; its rules forbid that Playwright's own waiting evaluates text there."""
    for _ in range(HANGS_MS // 50):
        found = tab.evaluate(f"() => {code}")
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"never: {code}")
