"""Notable findings of a piece for the report: differences of sides, unusual strokes, drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import with_unit
from oarlock.rowing.strokes.table import Floats

LEAST = {
    "deg": 2.0,
    "deg/s": 20.0,
    "ms": 20.0,
    "s": 0.05,
    "%": 3.0,
    "cm": 2.0,
    "m": 0.02,
    "m/s": 0.1,
    "1/min": 1.0,
}
"""In shown units. Smaller differences are not reported, even when statistically certain. The play of a swivel
alone is 1.3 deg (Kleshnev, biorow.com/rbn2025_10)."""
ODD_SIGMAS = 4.0
"""A stroke is unusual if it is this many robust standard deviations from the median."""
FEWEST_STROKES = 6
"""Smallest number of strokes for drift and unusual strokes."""
SIDED = ("r_", "l_")
ARM = ("arm_plane", "elbow", "forearm", "shoulder")
"""Joints of the arm, which depend on oar, seat and trunk and are least certain: they are reported last."""


@dataclass(frozen=True)
class _Column:
    feature: Feature
    values: Floats
    time_s: Floats
    numbers: Floats


def findings(piece: Piece, last: Piece | None = None, best: Piece | None = None) -> list[Finding]:
    """Findings, the largest first and joints of the arm last; empty if there are none."""
    own = [name for name in piece.averages if not name.startswith(SIDED)]
    columns = [_column(piece, name) for name in own if feature_of(name).shown_unit in LEAST]
    enough = [column for column in columns if len(column.values) >= FEWEST_STROKES]
    found = [*_sides(piece), *_drifts(enough), *_odd_strokes(enough)]
    return sorted(found, key=lambda one: (any(word in one.name for word in ARM), -one.weight))


def compares_sides(piece: Piece) -> bool:
    """Whether right and left should agree; two hands on one oar move differently by design."""
    return bool(piece.sides) and "oar_phi" not in piece.track.joint_names


def least(feature: Feature) -> float:
    """The smallest reported difference, in the feature's own unit; NaN if none is defined."""
    return LEAST.get(feature.shown_unit, float("nan")) / feature.shown_scale


def _column(piece: Piece, name: str) -> _Column:
    good = piece.counted & np.isfinite(piece.table[name])
    numbers = np.asarray(np.flatnonzero(good) + 1, dtype=np.float64)
    return _Column(feature_of(name), piece.table[name][good], piece.table["catch_time_s"][good], numbers)


def _sides(piece: Piece) -> list[Finding]:
    """Differences between right and left that exceed both uncertainties."""
    found: list[Finding] = []
    if not compares_sides(piece):
        return found
    for name, apart in piece.sides.items():
        weight = abs(apart.over.mean) / least(apart.feature)
        if not weight > 1.0 or not apart.beyond_zero:
            continue
        label = apart.feature.label.rpartition(",")[0]
        right, left = (piece.averages[f"{side}_{name}"] for side in "rl")
        shown_right, shown_left = (with_unit(one.feature, one.over.mean) for one in (right, left))
        sentence = f"{_capital(label)}: right {shown_right}, left {shown_left}."
        found.append(
            _finding(apart.feature, name, "sides", sentence, apart.over.mean, apart.uncertainty, weight)
        )
    return found


def _drifts(columns: list[_Column]) -> list[Finding]:
    """Columns whose last third differs from the first by more than the scatter of strokes."""
    found = []
    for column in columns:
        third = max(len(column.values) // 3, 2)
        first, last = column.values[:third], column.values[-third:]
        change = float(last.mean() - first.mean())
        scatter = float(np.hypot(first.std(ddof=1), last.std(ddof=1)) / np.sqrt(third))
        weight = abs(change) / least(column.feature)
        if weight > 1.0 and abs(change) > 3.0 * scatter:
            began, ended = (with_unit(column.feature, float(part.mean())) for part in (first, last))
            label = _capital(column.feature.label)
            sentence = f"{label} went from {began} to {ended} over the piece."
            found.append(
                _finding(column.feature, column.feature.name, "drift", sentence, change, scatter, weight)
            )
    return found


def _odd_strokes(columns: list[_Column]) -> list[Finding]:
    """Strokes far from the median of their piece, each with the number that is farthest."""
    worst: dict[float, Finding] = {}
    for column in columns:
        middle = float(np.median(column.values))
        robust = 1.4826 * float(np.median(np.abs(column.values - middle)))
        off = np.abs(column.values - middle)
        for k in np.flatnonzero((off > ODD_SIGMAS * robust) & (off > least(column.feature))):
            weight, number = float(off[k]) / least(column.feature), float(column.numbers[k])
            if number not in worst or weight > worst[number].weight:
                sentence = _odd(column, int(k), middle)
                worst[number] = _finding(
                    column.feature,
                    column.feature.name,
                    "odd stroke",
                    sentence,
                    float(column.values[k] - middle),
                    robust,
                    weight,
                )
    return list(worst.values())


def _odd(column: _Column, k: int, middle: float) -> str:
    value, usual = (with_unit(column.feature, number) for number in (float(column.values[k]), middle))
    return (
        f"Stroke {column.numbers[k]:.0f} (at {column.time_s[k]:.1f} s) is unusual: {column.feature.label} "
        f"{value}; the median of all strokes is {usual}."
    )


def _finding(
    feature: Feature, name: str, kind: str, sentence: str, size: float, size_1sd: float, weight: float
) -> Finding:
    scale = feature.shown_scale
    return Finding(name, kind, sentence, size * scale, size_1sd * scale, feature.shown_unit, weight=weight)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
