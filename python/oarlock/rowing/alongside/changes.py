"""What changed within an export, or against another one, after removing the effect of the stroke rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.strokes.table import Floats, StrokeTable

LEAST = {"deg": 2.0, "s": 0.03, "%": 3.0, "m": 0.02, "cm": 2.0, "m/s": 0.1}
"""In shown units; the play of a swivel alone is 1.3 deg (Kleshnev, biorow.com/rbn2025_10)."""
LEAST_SHARE = 0.05
"""Of the mean, for force, work, power: makers' and reference values differ by more (doi 10.3389/fphys.2021.758015)."""
LEAST_HEART = 5.0
"""Beats a minute."""
FEWEST = 12
SIGMAS = 3.0
RATES_PER_MIN = (14.0, 50.0)
"""Strokes outside are paddling or misread."""
WHOLE = 0.5
"""Strokes with less than this share of the median handle travel or arc are no whole strokes."""
_LENGTHS = ("handle_travel_m", "arc_rad", "curve_arc_rad")
_SKIPPED = {
    "time_s",
    "catch_time_s",
    "finish_time_s",
    "end_time_s",
    "interval",
    "stroke_number",
    "distance_m",
    "impeller_distance_m",
    "in_averages",
    "rate_per_min",
    "duration_s",
    "recovery_time_s",
    "recovery_before_s",
    "drag_factor",
    "distance_per_stroke_m",
}
"""Columns of the clock, of order, and those that restate the rate or the speed."""


@dataclass(frozen=True)
class Change:
    """A difference of one quantity, at equal rate.

    Attributes:
        name: of the column.
        size: in the column's unit.
        size_1sd: standard deviation of `size`, from the scatter between strokes.
        before: mean of the first third, or of the other piece.
        after: `before` plus `size`.
        weight: size over the smallest difference that is reported.
    """

    name: str
    size: float
    size_1sd: float
    before: float
    after: float
    weight: float

    @property
    def feature(self) -> Feature:
        """What the quantity is."""
        return FEATURES[self.name]


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


def changes_within(table: StrokeTable) -> list[Change]:
    """Last third against first third of the counted strokes, the largest first; empty with too few."""
    rows = np.flatnonzero(counted_strokes(table))
    if len(rows) < 2 * FEWEST:
        return []
    third = len(rows) // 3
    return _changes(table, rows[:third], table, rows[-third:])


def changes_between(table: StrokeTable, other: StrokeTable) -> list[Change]:
    """This export against another, the largest first; empty with too few strokes."""
    return _changes(
        other, np.flatnonzero(counted_strokes(other)), table, np.flatnonzero(counted_strokes(table))
    )


def _changes(
    first: StrokeTable, first_rows: NDArray[np.int64], last: StrokeTable, last_rows: NDArray[np.int64]
) -> list[Change]:
    names = [name for name in last.columns if name in first and name in FEATURES and name not in _SKIPPED]
    found = [
        change
        for name in names
        if (change := _change(name, _with_rate(first, name, first_rows), _with_rate(last, name, last_rows)))
    ]
    return sorted(_without_repeats(found), key=lambda one: -one.weight)


def _with_rate(table: StrokeTable, name: str, rows: NDArray[np.int64]) -> Floats:
    """(K, 2): the quantity and the rate, where both are known; rate 0 without one."""
    rate = table["rate_per_min"][rows] if "rate_per_min" in table else np.zeros(len(rows))
    both = np.column_stack([table[name][rows], rate])
    return np.asarray(both[np.isfinite(both).all(axis=1)])


def _change(name: str, first: Floats, last: Floats) -> Change | None:
    """The difference at equal rate by least squares; None if it is small or within the scatter."""
    if min(len(first), len(last)) < FEWEST:
        return None
    value = np.concatenate([first[:, 0], last[:, 0]])
    rate = np.concatenate([first[:, 1], last[:, 1]])
    is_last = np.repeat([0.0, 1.0], [len(first), len(last)])
    columns = [np.ones(len(value)), is_last]
    if np.ptp(rate) > 0.0:
        columns.append(rate - rate.mean())
    design = np.column_stack(columns)
    effect, *_ = np.linalg.lstsq(design, value, rcond=None)
    rest = value - design @ effect
    variance = float(rest @ rest) / (len(value) - design.shape[1]) * _related(rest)
    std = math.sqrt(variance * float(np.linalg.pinv(design.T @ design)[1, 1]))
    before, size = float(first[:, 0].mean()), float(effect[1])
    weight = abs(size) / _least(FEATURES[name], float(np.abs(value).mean()))
    if weight < 1.0 or abs(size) < SIGMAS * std:
        return None
    return Change(name, size, std, before, before + size, weight)


def _related(rest: Floats) -> float:
    """How much larger the variance of a mean is because neighbouring strokes are related."""
    power = float(rest @ rest)
    ahead = min(max(float(rest[1:] @ rest[:-1]) / power if power else 0.0, 0.0), 0.9)
    return (1.0 + ahead) / (1.0 - ahead)


def _least(feature: Feature, mean: float) -> float:
    if feature.shown_unit in LEAST:
        return LEAST[feature.shown_unit] / feature.shown_scale
    return LEAST_HEART if feature.name == "heart_rate_per_min" else max(LEAST_SHARE * mean, 1e-9)


USUAL = {
    "slip_rad": "Targets are 6 deg in sculling and 9 deg in sweep (KNRB, by RtcNoordApp).",
    "wash_rad": "NK's goal in steady state is below 12 deg (nksports.com, faq 243).",
    "catch_angle_rad": "NK's guideline for sculling is -65 deg. The catch angle was among the largest modifiers of "
    "boat speed at given power and rate (Holt 2020, doi 10.3389/fspor.2020.589013).",
    "finish_angle_rad": "NK's guideline for sculling is +40 deg.",
}
"""Published values and why a quantity matters, each with its source; only what has one."""
_FAMILIES = (
    ("handle_travel_m", "curve_handle_travel_m"),
    ("peak_force_n", "curve_peak_force_n", "mean_force_n"),
    ("peak_force_position_m", "curve_peak_force_position_m"),
    ("power_w", "work_j", "curve_work_j"),
    ("arc_rad", "curve_arc_rad", "effective_arc_rad"),
    ("drive_time_s", "rhythm"),
    ("speed_m_s", "impeller_speed_m_s"),
)
"""Columns that say the same: only the largest change of each family is reported."""


def _without_repeats(found: list[Change]) -> list[Change]:
    family = {name: k for k, names in enumerate(_FAMILIES) for name in names}
    best: dict[object, Change] = {}
    for change in found:
        key = family.get(change.name, change.name)
        if key not in best or change.weight > best[key].weight:
            best[key] = change
    return list(best.values())
