"""Time stamps for files without any: rows at a constant rate. Used by the readers of data sets."""

import numpy as np

from oarlock.storage.arrays import Floats


def row_times_s(rows: int, rate_hz: float) -> Floats:
    """Rows from 0 s on, (rows,) s."""
    return np.arange(rows) / rate_hz


def interval_middles_s(rows: int, rate_hz: float) -> Floats:
    """Middles of the intervals that end at the rows, (rows,) s; the first is half a step before 0 s.

    For units that average fast readings since the previous row: such a reading belongs to the middle of its interval,
    and an orientation computed with it belongs to the end.
    """
    return row_times_s(rows, rate_hz) - 0.5 / rate_hz
