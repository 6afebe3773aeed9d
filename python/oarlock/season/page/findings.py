"""`AthleteComparison`: a trend or a step at a change of rig that is beyond chance, among all comparisons of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oarlock.evaluation.distributions import student_tail
from oarlock.season.questions.ask import MONTHS_FOR_CHANGE

FALSE_SHARE = 0.05
"""Expected share of false ones among the changes listed, at most."""


@dataclass(frozen=True)
class AthleteComparison:
    """One comparison of an athlete with itself, in the unit of the column.

    Args:
        athlete: the pseudonym.
        metric: the column.
        kind: "trend", from the first month to the last, or "rig", after a change of rig against before.
        change: its size.
        low: lower end of the 95 % band.
        high: upper end.
        chance: probability of a change of this size or larger without a true one (two-sided).
        sessions: how many it comes from.
        period: for people, such as "2025-11 to 2026-10".
    """

    athlete: str
    metric: str
    kind: str
    change: float
    low: float
    high: float
    chance: float
    sessions: int
    period: str

    @property
    def against_band(self) -> float:
        """Size of the change in half widths of its band; above 1 the band does not contain 0."""
        return abs(self.change) / max(0.5 * (self.high - self.low), 1e-300)


def trend_comparison(metric: str, row: Mapping[str, Any]) -> AthleteComparison | None:
    """A row of the question `changes`; None if there are too few months."""
    if row["se"] is None or not row["se"] > 0.0 or row["months"] < MONTHS_FOR_CHANGE or not row["per_month"]:
        return None
    span = row["change"] / row["per_month"]
    return AthleteComparison(
        row["athlete"],
        metric,
        "trend",
        row["change"],
        row["low"] * span,
        row["high"] * span,
        _chance(row["per_month"] / row["se"], row["months"] - 2),
        row["sessions"],
        f"{row['first_month']} to {row['last_month']}",
    )


def rig_comparison(metric: str, row: Mapping[str, Any]) -> AthleteComparison | None:
    """A row of the question `rig`."""
    if row["low"] is None or row["se"] is None or not row["se"] > 0.0:
        return None
    fewer = min(row["n_before"], row["n_after"])
    return AthleteComparison(
        row["athlete"],
        metric,
        "rig",
        row["change"],
        row["low"],
        row["high"],
        _chance(row["change"] / row["se"], fewer - 1),
        row["n_before"] + row["n_after"],
        f"{row['before']} to {row['after']}, {row['day']}",
    )


def beyond_chance(
    comparisons: Sequence[AthleteComparison], false_share: float = FALSE_SHARE
) -> list[AthleteComparison]:
    """Those that stay after a correction for the number of comparisons, largest against their band first.

    The procedure of Benjamini and Hochberg (1995) limits the expected share of false ones among those listed.
    """
    chances = np.sort(np.array([one.chance for one in comparisons]))
    limits = false_share * np.arange(1, len(chances) + 1) / max(len(chances), 1)
    under = np.flatnonzero(chances <= limits)
    if not len(under):
        return []
    limit = chances[under[-1]]
    found = [one for one in comparisons if one.chance <= limit]
    return sorted(found, key=lambda one: (-one.against_band, one.athlete, one.metric))


def _chance(ratio: float, freedom: int) -> float:
    return 2.0 * student_tail(ratio, max(freedom, 1))
