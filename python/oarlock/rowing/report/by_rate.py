"""The main numbers of a piece by stroke rate, where the rate rises or falls: a table for the front of a report."""

from __future__ import annotations

from html import escape

import numpy as np

from oarlock.report import plain_table
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.find import least
from oarlock.rowing.report.averages import beyond, feature_of
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread
from oarlock.rowing.report.tables import link
from oarlock.rowing.report.words import is_ramp
from oarlock.storage.arrays import Floats, Indices
from oarlock.storage.statistics import NORMAL_95

_NUMBERS = (
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "rhythm",
    "handle_peak_speed_m_s",
    "style_factor",
)
_GROUPS = 4
_FEWEST = 3
"""Strokes of a group."""


def by_rate(piece: ReportPiece) -> str:
    """Means of groups of strokes of similar rate; markup, "" if the rate is about the same in the whole piece."""
    rates, ordered = piece.table["rate_per_min"], _groups(piece)
    if not ordered:
        return ""
    ends = [f"{rates[group].mean():.0f}/min" for group in ordered]
    lines = []
    for feature in map(feature_of, _NUMBERS):
        head = link(feature.name, f"{feature.label}, {joined_unit(feature).strip()}")
        lines.append([head, *(_mean(piece, feature, group) for group in ordered)])
    caption = (
        f"By stroke rate: means of strokes of similar rate. {PLUS_MINUS} here: 95 % interval from the scatter alone, "
        "to compare columns; errors of sensors and mounts, the same in all columns, come on top."
    )
    return plain_table("by-rate", caption, ["number", *ends], lines)


def range_over_rate(piece: Counted, name: str) -> str:
    """What a number is from the lowest to the highest rates of a ramp, such as "37.9 to 44.3 %"; else "".

    "" also if it does not clearly follow the rate: then one mean with its interval says more.
    """
    groups = _groups(piece)
    if not groups or name not in piece.table:
        return ""
    feature = feature_of(name)
    ends = [_known(piece.table[name][group]) for group in (groups[0], groups[-1])]
    if min(map(len, ends)) < 2:
        return ""
    first, last = (float(end.mean()) for end in ends)
    doubt = float(np.sqrt(sum(end.var(ddof=1) / len(end) for end in ends)))
    if not beyond(last - first, doubt) or abs(last - first) <= least(feature):
        return ""
    return f"{shown(feature, first)} to {shown(feature, last)}{joined_unit(feature)}"


def _groups(piece: Counted) -> list[Indices]:
    """Indices of the counted strokes in groups of similar rate, the slowest first; [] without a ramp."""
    rates = piece.table["rate_per_min"]
    rows = np.flatnonzero(piece.counted & np.isfinite(rates))
    groups = min(_GROUPS, len(rows) // _FEWEST)
    if not is_ramp(piece) or groups < 2:
        return []
    return np.array_split(rows[np.argsort(rates[rows], kind="stable")], groups)


def _known(values: Floats) -> Floats:
    return values[np.isfinite(values)]


def _mean(piece: ReportPiece, feature: Feature, rows: Indices) -> str:
    values = _known(piece.table[feature.name][rows])
    if len(values) < 2:
        return '<span class="mark">not known</span>'
    half = NORMAL_95 * float(values.std(ddof=1)) / np.sqrt(len(values))
    mean = escape(shown(feature, float(values.mean())))
    return f'{mean} <span class="mark">{PLUS_MINUS} {spread(feature, half)}</span>'
