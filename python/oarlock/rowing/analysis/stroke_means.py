"""Means of numbers and curves over strokes, with spread and uncertainty, for `Technique`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.analysis.stroke_grid import FINISH, PhaseGrid
from oarlock.rowing.analysis.stroke_values import Values
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats

_FAR_FROM_ZERO = 5.0
"""Mean over SD from which on a coefficient of variation says something."""


@dataclass(frozen=True)
class FeatureMean:
    """A number averaged over the counted strokes, in its own unit.

    Attributes:
        name: of the column.
        count: strokes that have it.
        mean: over them.
        sd: from stroke to stroke, with the noise of the measurement; NaN of fewer than two.
        least: smallest.
        most: largest.
        std: uncertainty of the mean. Errors of mounts, lengths and zeros are the same in every stroke, so this is the
            root mean square of the strokes' standard deviations, not divided by the root of their number.
        cv: sd over the mean; NaN where it misleads: with a sign, as angles and timing have, or a mean near zero.
    """

    name: str
    count: int
    mean: float
    sd: float
    least: float
    most: float
    std: float
    cv: float


@dataclass(frozen=True, eq=False)
class PhaseCurve:
    """A curve over the stroke, (101,) each, from catch (0 %) to next catch (100 %).

    Attributes:
        percent: share of the time from catch to next catch.
        mean: over the strokes that count.
        sd: from stroke to stroke at each point.
        std: uncertainty that all strokes share.
        finish_percent: where the finish is on average.
        count: strokes.
    """

    percent: Floats
    mean: Floats
    sd: Floats
    std: Floats
    finish_percent: float
    count: int


def feature_means(table: StrokeTable, counted: Bools) -> Mapping[str, FeatureMean]:
    """Every column but times of the clock and the flag itself."""
    skipped = ("catch_time_s", "finish_time_s", "end_time_s", "in_averages")
    names = [name for name in table.columns if not name.endswith(skipped)]
    return MappingProxyType({name: _mean(name, table[name], table.std(name), counted) for name in names})


def side_differences(table: StrokeTable, counted: Bools) -> Mapping[str, FeatureMean]:
    """Right minus left of every number that both sides have, by its name without the side."""
    found = {}
    for name in table.columns:
        stem = name.removeprefix("r_")
        if stem == name or f"l_{stem}" not in table.columns or stem.endswith("_time_s"):
            continue
        apart = table[name] - table[f"l_{stem}"]
        found[stem] = _mean(
            stem, apart, np.hypot(table.std(name), table.std(f"l_{stem}")), counted, signed=True
        )
    return MappingProxyType(found)


def _mean(name: str, values: Floats, stds: Floats, counted: Bools, signed: bool = False) -> FeatureMean:
    own = values[counted & np.isfinite(values)]
    spread = stds[counted & np.isfinite(values)]
    if len(own) == 0:
        return FeatureMean(name, 0, *[np.nan] * 6)
    mean, sd = float(np.mean(own)), float(np.std(own, ddof=1)) if len(own) > 1 else np.nan
    signed = signed or name not in FEATURES or bool(FEATURES[name].sign)
    cv = sd / mean if not signed and mean > 0.0 and mean >= _FAR_FROM_ZERO * sd else np.nan
    known = spread[np.isfinite(spread)]
    std = float(np.sqrt(np.mean(known**2))) if len(known) else np.nan
    return FeatureMean(name, len(own), mean, sd, float(own.min()), float(own.max()), std, cv)


def phase_curves(
    grid: PhaseGrid, values: Values, stds: Values, counted: Bools, names: Sequence[str]
) -> Mapping[str, PhaseCurve]:
    """Mean and spread of curves (N, POINTS) on the grid."""
    whole = counted & np.isfinite(grid.phase).all(axis=1)
    if not whole.any():
        return MappingProxyType({})
    percent = np.linspace(0.0, 100.0, 101)
    finish = float(100.0 * grid.phase[whole, FINISH].mean())
    curves = {}
    for name in names:
        own = whole & np.isfinite(values[name]).all(axis=1)
        if own.any():
            rows, spread = (_normalised(grid, of[name], own) for of in (values, stds))
            sd = np.std(rows, axis=0, ddof=1) if len(rows) > 1 else np.full(101, np.nan)
            std = np.sqrt(np.mean(spread**2, axis=0))
            curves[name] = PhaseCurve(percent, rows.mean(axis=0), sd, std, finish, len(rows))
    return MappingProxyType(curves)


def _normalised(grid: PhaseGrid, values: Floats, rows: Bools) -> Floats:
    percent = np.linspace(0.0, 1.0, 101)
    return np.array([np.interp(percent, p, v) for p, v in zip(grid.phase[rows], values[rows], strict=True)])
