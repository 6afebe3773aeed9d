"""Means over the strokes of a piece, how well each is known, and whether two differ by more than that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.analysis.stroke_means import FeatureMean
from oarlock.rowing.strokes.table import StrokeTable

SIGMAS_95 = 1.96
"""Half the width of a 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Average:
    """A number over the strokes that count, SI and radians.

    Attributes:
        feature: what it is.
        over: its mean, spread and what averaging does not remove.
        reason: why no stroke has it, "" where one has.
    """

    feature: Feature
    over: FeatureMean
    reason: str = ""

    @property
    def known(self) -> bool:
        """Whether any stroke that counts has it."""
        return self.over.count > 0

    @property
    def uncertainty(self) -> float:
        """Standard deviation of the mean.

        What the bands say of a stroke may be the same error in all of them (a mount, a length), so it is not divided
        by the number of strokes; what differs between strokes is. NaN where the bands say nothing.
        """
        scatter = self.over.sd**2 / self.over.count if self.over.count > 1 else 0.0
        return math.sqrt(self.over.std**2 + scatter)

    @property
    def beyond_zero(self) -> bool | None:
        """Of a difference: whether it is more than its uncertainty explains, at 95 %; None where that is unknown."""
        return beyond(self.over.mean, self.uncertainty)


@dataclass(frozen=True)
class Difference:
    """Of two averages of one feature, this minus the other."""

    feature: Feature
    value: float
    uncertainty: float

    @property
    def beyond(self) -> bool | None:
        """Whether it is larger than both uncertainties together explain, at 95 %; None where these are unknown."""
        return beyond(self.value, self.uncertainty)


def beyond(value: float, uncertainty: float) -> bool | None:
    """Whether a value lies outside the 95 % interval about 0; None where either is unknown."""
    if not (math.isfinite(value) and math.isfinite(uncertainty)):
        return None
    return abs(value) > SIGMAS_95 * uncertainty


def feature_of(name: str) -> Feature:
    """What is known of a column; of a foreign one its name alone."""
    return FEATURES.get(name) or Feature(
        name, name.replace("_", " "), "", "", "", "", "the file it came from"
    )


def averages(table: StrokeTable, means: Mapping[str, FeatureMean]) -> dict[str, Average]:
    """By name, with the reason where no stroke has the number."""
    return {name: Average(feature_of(name), mean, _reason(table, name, mean)) for name, mean in means.items()}


def difference(this: Average, other: Average) -> Difference:
    """This minus the other."""
    apart = this.over.mean - other.over.mean
    return Difference(this.feature, apart, math.hypot(this.uncertainty, other.uncertainty))


def _reason(table: StrokeTable, name: str, mean: FeatureMean) -> str:
    if mean.count:
        return ""
    told = [reason for reason in table.reason(name) if reason]
    return told[0] if told else "no stroke that counts has it"
