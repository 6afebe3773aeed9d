"""Progress of long computations: what the argument `progress` of public functions accepts, and how it is shown.

Used by every function that can take longer than two seconds, and by the command line.
"""

from __future__ import annotations

import importlib
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, Final, TypeAlias

Told: TypeAlias = Callable[[float], object]
"""Called regularly with the share done, 0 to 1."""
Progress: TypeAlias = bool | Told | None
"""Argument of public functions: True shows the progress, a function is called with the share done, 0 to 1."""

FIRST_LINE_S, LINES_S = 5.0, 10.0
"""Without a terminal progress is a line after so long, and then each so long."""
_ESTIMATED_AFTER_S: Final = 60.0
_REDRAWN_S: Final = 0.2


@contextmanager
def shown(progress: Progress, text: str) -> Iterator[Told | None]:
    """What to call with the share done, or None; shows it for as long as the block lasts if `progress` is True."""
    if progress is True:
        with display(text) as told:
            yield told
    else:
        yield progress or None


def share(progress: Told | None, start: float, end: float) -> Told | None:
    """A callback for the part from `start` to `end` of the whole, each 0 to 1."""
    return None if progress is None else lambda done: progress(start + (end - start) * done)


def mark(progress: Told | None, done: float) -> None:
    """Tell the share done, if anybody wants to know."""
    if progress is not None:
        progress(done)


def display(text: str) -> AbstractContextManager[Callable[[float], None]]:
    """Progress where the user looks: a bar in a notebook or on a terminal, elsewhere lines on stderr."""
    marimo, ipython = sys.modules.get("marimo"), sys.modules.get("IPython")
    if marimo is not None and marimo.running_in_notebook():
        return _marimo_bar(text)
    if ipython is not None and type(ipython.get_ipython()).__name__ == "ZMQInteractiveShell":
        return _jupyter_bar(text)
    return _terminal_bar(text) if sys.stderr.isatty() else progress_lines(text)


@contextmanager
def progress_lines(text: str) -> Iterator[Callable[[float], None]]:
    """A line on stderr after `FIRST_LINE_S`, then one each `LINES_S`, from a thread: computations call rarely."""
    share_done = 0.0
    ended, out, began_s = threading.Event(), sys.stderr, time.monotonic()

    def lines() -> None:
        pause_s = FIRST_LINE_S
        while not ended.wait(pause_s):
            with suppress(OSError, ValueError):  # nobody reads it any more
                out.write(f"{text}: {progress_words(share_done, time.monotonic() - began_s)}\n")
                out.flush()
            pause_s = LINES_S

    def told(share: float) -> None:
        nonlocal share_done
        share_done = share

    writer = threading.Thread(target=lines, name="progress", daemon=True)
    writer.start()
    try:
        yield told
    finally:
        ended.set()
        writer.join()


def progress_words(share: float, elapsed_s: float) -> str:
    """Such as "12 %, 90 s, about 11 min left"; what is left only after a minute, when it can be estimated."""
    words = f"{100.0 * share:.0f} %, " if share > 0.0 else ""
    words += f"{elapsed_s:.0f} s"
    if elapsed_s < _ESTIMATED_AFTER_S or not 0.0 < share < 1.0:
        return words
    return f"{words}, about {math.ceil(elapsed_s * (1.0 - share) / share / 60.0)} min left"


@contextmanager
def _terminal_bar(text: str) -> Iterator[Callable[[float], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(30), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True, highlight=False), transient=True) as bar:
        task = bar.add_task(text, total=None)

        def told(share: float) -> None:
            bar.update(task, completed=share, total=1.0)

        yield told


# --- notebooks ----------------------------------------------------------------------------------------
# rich draws in Jupyter only with ipywidgets, and in marimo not at all.


@contextmanager
def _marimo_bar(text: str) -> Iterator[Callable[[float], None]]:
    import marimo

    with marimo.status.progress_bar(total=100, title=text, remove_on_exit=True) as bar:
        shown_percent = 0

        def told(share: float) -> None:
            nonlocal shown_percent
            percent = min(100, int(100.0 * share))
            if percent > shown_percent:
                bar.update(increment=percent - shown_percent)
                shown_percent = percent

        yield told


@contextmanager
def _jupyter_bar(text: str) -> Iterator[Callable[[float], None]]:
    page: Any = importlib.import_module("IPython.display")

    name = f"oarlock-{threading.get_ident()}-{time.monotonic_ns()}"
    drawn_s = time.monotonic()

    def bar(value: str) -> Any:
        return page.HTML(f"<label>{text} <progress {value}></progress></label>")

    def told(share: float) -> None:
        nonlocal drawn_s
        if time.monotonic() - drawn_s >= _REDRAWN_S:
            drawn_s = time.monotonic()
            page.update_display(bar(f'max="1" value="{share:.3f}"'), display_id=name)

    page.display(bar(""), display_id=name)
    try:
        yield told
    finally:
        page.update_display(page.HTML(""), display_id=name)
