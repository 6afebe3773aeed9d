"""How a metric of a season is shown to people: label, unit, and the factor from its column's unit."""

from __future__ import annotations

from dataclasses import dataclass

SCALED = (
    "mean",
    "low",
    "high",
    "per_month",
    "change",
    "sd",
    "noise",
    "first",
    "last",
    "drift",
    "difference",
    "se",
)
"""Columns of the ready questions that are in the unit of the metric."""


@dataclass(frozen=True)
class ShownMetric:
    """How a metric is shown.

    Args:
        label: for people.
        unit: such as "deg"; empty without one.
        scale: a number of the column times this is in `unit`.
    """

    label: str
    unit: str
    scale: float


def shown_metric(column: str) -> ShownMetric:
    """How a column is shown; one that Oarlock does not define is shown as it is."""
    from oarlock.rowing import FEATURES

    feature = FEATURES.get(column)
    if feature is None:
        return ShownMetric(column, "", 1.0)
    return ShownMetric(
        feature.label, "" if feature.shown_unit == "1" else feature.shown_unit, feature.shown_scale
    )


def is_scaled(column: str) -> bool:
    """Whether a column of a ready question is in the unit of the metric."""
    return column.removesuffix("_before").removesuffix("_after") in SCALED
