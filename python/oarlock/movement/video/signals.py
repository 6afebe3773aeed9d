"""Motion signals on an even grid of time: what picture and body are compared by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.even_times import even_times

STEP_S = 0.02
HIGHEST_HZ = 5.0
"""Above this both signals are removed: people move slower, and a picture's noise is mostly above."""
LONGEST_GAP_S = 0.25
"""Longer gaps are not bridged; their samples do not count."""
SHORTEST_S = 4.0


@dataclass(frozen=True)
class Signals:
    """Signals (N, K) every `STEP_S` seconds from `start_s` on, in the clock of their source.

    Attributes:
        start_s: time of the first row, s.
        values: signals, in any unit: only their course counts; 0 in rows that are not valid.
        valid: rows (N,) that count.
    """

    start_s: float
    values: Floats
    valid: Bools

    def times_s(self) -> Floats:
        """Times (N,) of the rows, s."""
        return np.asarray(self.start_s + STEP_S * np.arange(len(self.values)), dtype=np.float64)

    def part(self, first_s: float, last_s: float) -> Signals:
        """Rows from `first_s` to `last_s`."""
        first = max(0, int(np.ceil((first_s - self.start_s) / STEP_S)))
        last = max(first, int(np.floor((last_s - self.start_s) / STEP_S)) + 1)
        return Signals(self.start_s + STEP_S * first, self.values[first:last], self.valid[first:last])


def even_signals(time_s: Floats, values: Floats, what: str) -> Signals:
    """Resample values (N, K) at times (N,) to the grid and remove what is faster than `HIGHEST_HZ`, without delay.

    Raises:
        DataError: less than 4 s, or nothing but gaps.
    """
    if len(time_s) < 8 or time_s[-1] - time_s[0] < SHORTEST_S:
        length = float(time_s[-1] - time_s[0]) if len(time_s) else 0.0
        raise DataError(
            f"{what} is {length:.1f} s long; at least {SHORTEST_S:g} s are needed to align by motion"
        )
    even = even_times(time_s, STEP_S, what)
    behind = np.clip(np.searchsorted(time_s, even, side="right"), 1, len(time_s) - 1)
    valid = time_s[behind] - time_s[behind - 1] <= LONGEST_GAP_S
    if not valid.any():
        raise DataError(
            f"{what} has fewer than {1 / LONGEST_GAP_S:g} samples in a second; that is too few to align"
        )
    columns = np.column_stack([np.interp(even, time_s, column) for column in values.T])
    slow = sosfiltfilt(butter(2, HIGHEST_HZ, fs=1.0 / STEP_S, output="sos"), columns, axis=0)
    return Signals(float(even[0]), np.where(valid[:, None], slow, 0.0), valid)


def main_courses(values: Floats, count: int) -> Floats:
    """The `count` courses (N, count) with most variance among the columns of `values` (N, C): principal components."""
    away = values - values.mean(axis=0)
    directions = np.linalg.svd(away.T @ away)[0]
    main: Floats = away @ directions[:, :count]
    return main
