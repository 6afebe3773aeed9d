"""Groups what one system measures at the same time, for emulators that send all of it in one message."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from oarlock.live.emulators.deliveries import Delivery
from oarlock.live.emulators.emulated import Emulated


def frames(emulated: Emulated) -> Iterator[list[Delivery]]:
    """The readings of one system, those with the same stamp together."""
    for _, together in groupby(emulated.deliveries(is_one_device=True), lambda one: (one.due_s, one.clock_s)):
        yield list(together)
