"""Means over the strokes of a piece, how well each is known, and whether two differ by more than that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.features import FEATURES, Feature
from oarlock.rowing.stroke_table import Floats, StrokeTable

SIGMAS_95 = 1.96
"""Half the width of a 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Average:
    """A number of the strokes, over the strokes: SI and radians.

    Attributes:
        feature: what it is.
        count: strokes that have it.
        mean: over them.
        sd: between them; NaN of a single stroke.
        low: the least.
        high: the largest.
        std: standard deviation of one stroke's number by the track's bands, root mean square; NaN where unknown.
        reason: why no stroke has it, "" where one has.
    """

    feature: Feature
    count: int
    mean: float
    sd: float
    low: float
    high: float
    std: float
    reason: str = ""

    @property
    def uncertainty(self) -> float:
        """Standard deviation of the mean.

        What the bands say of a stroke may be the same error in all of them (a mount, a length), so it is not divided
        by the number of strokes; what differs between strokes is. NaN where the bands say nothing.
        """
        scatter = self.sd**2 / self.count if self.count > 1 else 0.0
        return math.sqrt(self.std**2 + scatter)


@dataclass(frozen=True)
class Difference:
    """Of two averages of one feature, second minus first."""

    feature: Feature
    value: float
    uncertainty: float

    @property
    def beyond(self) -> bool | None:
        """Whether it is larger than both uncertainties together explain, at 95 %; None where these are unknown."""
        if not (math.isfinite(self.value) and math.isfinite(self.uncertainty)):
            return None
        return abs(self.value) > SIGMAS_95 * self.uncertainty


def feature_of(name: str) -> Feature:
    """What is known of a column; of a foreign one its name alone."""
    return FEATURES.get(name) or Feature(
        name, name.replace("_", " "), "", "", "", "", "the file it came from"
    )


def counted(table: StrokeTable) -> Floats:
    """Which strokes count in averages, (N,) as booleans in floats: all, where the table does not say."""
    return table["in_averages"] if "in_averages" in table else np.ones(len(table))


def average(table: StrokeTable, name: str) -> Average:
    """Of one column, over the strokes that count."""
    used = (counted(table) > 0.5) & np.isfinite(table[name])
    values, stds = table[name][used], table.std(name)[used]
    if not len(values):
        told = [reason for reason in table.reason(name) if reason]
        nothing = (math.nan,) * 5
        return Average(feature_of(name), 0, *nothing, told[0] if told else "not known")
    known = stds[np.isfinite(stds)]
    return Average(
        feature_of(name),
        len(values),
        float(values.mean()),
        float(values.std(ddof=1)) if len(values) > 1 else math.nan,
        float(values.min()),
        float(values.max()),
        float(np.sqrt(np.mean(known**2))) if len(known) else math.nan,
    )


def averages(table: StrokeTable) -> dict[str, Average]:
    """Of every column that is not a time on the clock or a mark, by name."""
    return {name: average(table, name) for name in table.columns if not _is_stamp(name)}


def difference(first: Average, second: Average) -> Difference:
    """Second minus first."""
    return Difference(
        first.feature, second.mean - first.mean, math.hypot(first.uncertainty, second.uncertainty)
    )


def _is_stamp(name: str) -> bool:
    plain = name.removeprefix("r_").removeprefix("l_")
    return plain in {"catch_time_s", "finish_time_s", "end_time_s", "in_averages"}
