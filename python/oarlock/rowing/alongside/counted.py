"""`counted_strokes`: which strokes of an export count, for its page and its charts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.strokes.table import StrokeTable

RATES_PER_MIN = (14.0, 50.0)
"""Strokes outside are paddling or misread."""
WHOLE = 0.5
"""Strokes with less than this share of the median handle travel or arc are no whole strokes."""
_LENGTHS = ("handle_travel_m", "arc_rad", "curve_arc_rad")


def counted_strokes(table: StrokeTable) -> NDArray[np.bool_]:
    """Which strokes count (N,): whole ones at a rate of rowing; all where the export has neither."""
    counted = np.ones(len(table), dtype=bool)
    if "rate_per_min" in table:
        low, high = RATES_PER_MIN
        counted &= (table["rate_per_min"] >= low) & (table["rate_per_min"] <= high)
    for name in _LENGTHS:
        if name in table and np.isfinite(table[name]).any():
            counted &= ~(table[name] < WHOLE * np.nanmedian(table[name]))
    return counted
