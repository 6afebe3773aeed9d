"""Moments at which a device sends, and when each arrives, for emulated devices that make their own values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

import numpy as np

from oarlock.live.emulators.emulated import Emulated

T = TypeVar("T")


def on_the_way(emulated: Emulated, moments: Iterable[tuple[float, T]]) -> Iterator[tuple[float, float, T]]:
    """Arrival (s from the start), time, and what is sent then, of each message that arrives.

    Args:
        emulated: faults, seed, and when it ends: with the recording, if that does not begin again.
        moments: time and what is sent, in order; without end.
    """
    faults, rng, last_s = emulated.faults, np.random.default_rng(emulated.seed), 0.0
    ends_s = np.inf if emulated.period_s is not None else emulated.recording.end_s
    waiting: list[tuple[float, T]] = []
    for time_s, sent in moments:
        if time_s > ends_s:
            return
        waiting.append((time_s, sent))
        if len(waiting) < faults.burst:
            continue
        last_s = max(last_s, time_s + 1e-3 * (faults.least_ms + rng.exponential(faults.jitter_ms)))
        for one in waiting:
            if rng.random() >= faults.loss:
                yield last_s, *one
        waiting.clear()
