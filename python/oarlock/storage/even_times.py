"""Times at even steps along rows, for what needs them: bounded by the rows, not by what their time stamps say."""

from __future__ import annotations

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

LONGEST_GAP_S = 60.0
MOST_PER_ROW = 200
MOST_FREE = 1_000_000
"""So many times in any case; above, so many for each row."""


def even_times(time_s: Floats, step_s: float, what: str) -> Floats:
    """From the first time stamp to the last one.

    Args:
        time_s: (T,) increasing, s.
        step_s: the step, s.
        what: for the error's text.

    Raises:
        DataError: far more times than rows would be needed: a clock was set, or its unit is wrong.
    """
    span_s = float(time_s[-1] - time_s[0])
    count = span_s / step_s
    if not count <= max(MOST_FREE, MOST_PER_ROW * len(time_s)):
        steps = np.diff(time_s)
        longest = int(np.argmax(steps))
        raise DataError(
            f"{what}: {len(time_s)} rows span {span_s:.4g} s, the longest silence {steps[longest]:.4g} s after "
            f"{time_s[longest]:.3f} s. Was a clock set, or are the time stamps in another unit than s? Cut the "
            "recording there (Recording.slice), or correct its time stamps."
        )
    return np.arange(time_s[0], time_s[-1], step_s)


def even_times_of_stretches(time_s: Floats, step_s: float) -> Floats:
    """The same within each stretch of rows without a gap of `LONGEST_GAP_S`, each to beyond its end."""
    edges = np.flatnonzero(np.diff(time_s) > max(LONGEST_GAP_S, 2.0 * step_s)) + 1
    return np.concatenate([np.arange(part[0], part[-1] + step_s, step_s) for part in np.split(time_s, edges)])
