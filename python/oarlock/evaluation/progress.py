"""Progress of one part of a longer computation, for functions that report the share done."""

from __future__ import annotations

from collections.abc import Callable

Told = Callable[[float], object]


def share(told: Told | None, start: float, end: float) -> Told | None:
    """A callback for the part from `start` to `end` of the whole, each 0 to 1."""
    return None if told is None else lambda done: told(start + (end - start) * done)
