"""Progress reporting of the parts of the reproduction."""

from __future__ import annotations

from collections.abc import Callable

Told = Callable[[float], object]


def share(told: Told | None, start: float, end: float) -> Told | None:
    """A listener for the stretch from `start` to `end` of the whole, each 0 to 1."""
    if told is None:
        return None
    return lambda done: told(start + (end - start) * done)
