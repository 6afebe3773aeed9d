"""Progress reporting of the parts of the reproduction."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], object]


def share(progress: Progress | None, start: float, end: float) -> Progress | None:
    """A progress function for the part from `start` to `end` of the whole, each 0 to 1."""
    if progress is None:
        return None
    return lambda done: progress(start + (end - start) * done)
