"""Means over the strokes of a piece, their uncertainty, and differences of two means, for the report's tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.analysis.stroke_means import FeatureMean
from oarlock.rowing.report.shown import apart, places
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.statistics import NORMAL_95


@dataclass(frozen=True)
class Average:
    """A number averaged over the counted strokes, SI and radians.

    Attributes:
        feature: what it is.
        over: its mean, spread and the uncertainty that averaging does not reduce.
        reason: why no stroke has it; "" if at least one has.
    """

    feature: Feature
    over: FeatureMean
    reason: str = ""

    @property
    def known(self) -> bool:
        """Whether any counted stroke has it."""
        return self.over.count > 0

    @property
    def uncertainty(self) -> float:
        """Standard deviation of the mean.

        The error of a single stroke may be the same in all strokes (a mount, a length), so it is not divided by the
        number of strokes. The scatter between strokes is. NaN without standard deviations.
        """
        scatter = self.over.sd**2 / self.over.count if self.over.count > 1 else 0.0
        return math.sqrt(self.over.std**2 + scatter)

    @property
    def half(self) -> float:
        """Half of the 95 % interval of the mean; NaN without standard deviations."""
        return NORMAL_95 * self.uncertainty


@dataclass(frozen=True)
class Difference:
    """Difference of two averages of one feature: this minus the other.

    Attributes:
        feature: what it is.
        value: not rounded.
        uncertainty: its standard deviation.
        told: difference of the two numbers as they are shown; `value` if they are not shown.
        now: the first mean, from which a difference of speed becomes one of pace.
    """

    feature: Feature
    value: float
    uncertainty: float
    told: float
    now: float = math.nan

    @property
    def half(self) -> float:
        """Half of its 95 % interval."""
        return NORMAL_95 * self.uncertainty

    @property
    def beyond(self) -> bool | None:
        """Whether it exceeds both uncertainties together (95 %), as shown too; None if these are unknown."""
        found = beyond(self.value, self.uncertainty)
        digits, scale = places(self.feature), self.feature.shown_scale
        return found and round(abs(self.told) * scale, digits) > round(self.half * scale, digits)


def beyond(value: float, uncertainty: float) -> bool | None:
    """Whether a value lies outside the 95 % interval about 0; None if either is unknown."""
    if not (math.isfinite(value) and math.isfinite(uncertainty)):
        return None
    return abs(value) > NORMAL_95 * uncertainty


def feature_of(name: str) -> Feature:
    """The feature of a column; for an unknown column only its name."""
    return FEATURES.get(name) or Feature(
        name, name.replace("_", " "), "", "", "", "", "the file it came from"
    )


def averages(table: StrokeTable, means: Mapping[str, FeatureMean]) -> dict[str, Average]:
    """Averages by name, with the reason if no stroke has the number."""
    return {name: Average(feature_of(name), mean, _reason(table, name, mean)) for name, mean in means.items()}


def difference(this: Average, other: Average) -> Difference:
    """This minus the other."""
    now, then = this.over.mean, other.over.mean
    uncertainty = math.hypot(this.uncertainty, other.uncertainty)
    return Difference(this.feature, now - then, uncertainty, apart(this.feature, now, then), now)


def _reason(table: StrokeTable, name: str, mean: FeatureMean) -> str:
    if mean.count:
        return ""
    told = [reason for reason in table.reason(name) if reason]
    return told[0] if told else "no counted stroke has it"
