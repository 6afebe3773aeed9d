"""The main numbers of a piece by stroke rate, where the rate rises or falls: a table for the front of a report."""

from __future__ import annotations

from html import escape

import numpy as np

from oarlock.report import plain_table
from oarlock.rowing.report.averages import SIGMAS_95, feature_of
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread
from oarlock.rowing.report.tables import link
from oarlock.rowing.report.words import is_ramp

_NUMBERS = ("arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm", "handle_peak_speed_m_s")
_GROUPS = 4
_FEWEST = 3
"""Strokes of a group."""


def by_rate(piece: Piece) -> str:
    """Means of groups of strokes of similar rate; markup, "" if the rate is about the same in the whole piece."""
    rates = piece.table["rate_per_min"]
    rows = np.flatnonzero(piece.counted & np.isfinite(rates))
    groups = min(_GROUPS, len(rows) // _FEWEST)
    if not is_ramp(piece) or groups < 2:
        return ""
    ordered = np.array_split(rows[np.argsort(rates[rows], kind="stable")], groups)
    ends = [f"{rates[group].mean():.0f}/min" for group in ordered]
    lines = [
        [link(name, _head(name)), *(_mean(piece, name, group) for group in ordered)] for name in _NUMBERS
    ]
    caption = f"By stroke rate: means of strokes of similar rate, {PLUS_MINUS} the 95 % interval from their scatter."
    return plain_table("by-rate", caption, ["number", *ends], lines)


def _head(name: str) -> str:
    feature = feature_of(name)
    return f"{feature.label}, {joined_unit(feature).strip()}"


def _mean(piece: Piece, name: str, rows: np.ndarray) -> str:
    feature, values = feature_of(name), piece.table[name][rows]
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return '<span class="mark">not known</span>'
    half = SIGMAS_95 * float(values.std(ddof=1)) / np.sqrt(len(values))
    mean = escape(shown(feature, float(values.mean())))
    return f'{mean} <span class="mark">{PLUS_MINUS} {spread(feature, half)}</span>'
