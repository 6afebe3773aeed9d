"""Progress of one part of a longer computation, for functions that report the share done."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], object]


def share(progress: Progress | None, start: float, end: float) -> Progress | None:
    """A callback for the part from `start` to `end` of the whole, each 0 to 1."""
    return None if progress is None else lambda done: progress(start + (end - start) * done)
