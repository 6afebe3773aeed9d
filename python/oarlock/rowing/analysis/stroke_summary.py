"""Median and percentiles of every column of a stroke table, for `oarlock rowing strokes`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.strokes.table import StrokeTable

_ORDER_ONLY = {
    "time_s",
    "catch_time_s",
    "finish_time_s",
    "end_time_s",
    "interval",
    "stroke_number",
    "distance_m",
    "impeller_distance_m",
    "in_averages",
}
"""Columns that identify the stroke; they have no meaningful median."""


@dataclass(frozen=True)
class SummaryRow:
    """One quantity over all strokes.

    Attributes:
        name: of the column.
        label: for people.
        unit: in which the numbers below stand.
        strokes: how many have a number.
        median: the middle one; half of the strokes lie below it.
        low: 5 % of the strokes lie below it.
        high: 5 % of the strokes lie above it.
    """

    name: str
    label: str
    unit: str
    strokes: int
    median: float
    low: float
    high: float


def summarise_strokes(table: StrokeTable) -> tuple[SummaryRow, ...]:
    """Median, 5th and 95th percentile of each quantity in its shown unit, degrees where radians are held.

    Medians, since exports contain starts, stops and misread strokes. Strokes that `in_averages` excludes do not count.
    """
    counted = table["in_averages"] != 0.0 if "in_averages" in table else np.ones(len(table), dtype=bool)
    told = [name for name in table.columns if name.removeprefix("r_").removeprefix("l_") not in _ORDER_ONLY]
    return tuple(_row(table, name, counted) for name in told)


def _row(table: StrokeTable, name: str, counted: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> SummaryRow:
    values = table[name][counted & np.isfinite(table[name])]
    feature = FEATURES.get(name)
    label, unit, scale = (
        (feature.label, feature.shown_unit, feature.shown_scale) if feature else (name, "", 1.0)
    )
    low, median, high = np.percentile(values, (5.0, 50.0, 95.0)) * scale if len(values) else (np.nan,) * 3
    return SummaryRow(name, label, unit, len(values), float(median), float(low), float(high))
