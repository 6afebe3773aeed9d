"""The strokes one by one, and the numbers of the piece, as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from oarlock.report import Column, fixed, sortable_table, value_cell
from oarlock.rowing.features import FEATURES
from oarlock.rowing.report.averages import Average, average, counted, difference, feature_of
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of
from oarlock.rowing.stroke_table import StrokeTable

FIRST_COLUMNS = (
    "rate_per_min",
    "drive_time_s",
    "rhythm",
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "seat_travel_m",
    "handle_travel_m",
    "catch_factor_s",
    "rowing_style_factor",
    "catch_lean_rad",
    "finish_lean_rad",
    "power_w",
    "peak_force_n",
)
"""Of the strokes table, where they are known; all columns are in strokes.csv."""


def link(name: str, label: str) -> str:
    """A label that leads to its definition."""
    return f'<a class="term" href="#def-{name.replace("_", "-")}">{escape(label)}</a>'


def strokes_table(table: StrokeTable, key: str = "strokes") -> str:
    """A row a stroke, sortable; below it means, scatter and what the track's bands say of one stroke."""
    names = [name for name in FIRST_COLUMNS if name in table and np.isfinite(table[name]).any()]
    columns = [Column("stroke"), Column("at", "s", FEATURES["catch_time_s"].in_words)]
    columns += [
        Column(feature_of(name).label, unit_of(feature_of(name)), feature_of(name).in_words) for name in names
    ]
    kept = counted(table) > 0.5
    rows = [_stroke_row(table, names, row, bool(kept[row])) for row in range(len(table))]
    means = {name: average(table, name) for name in names}
    foot = [
        ["mean", "", *(shown(means[name].feature, means[name].mean) for name in names)],
        ["SD", "", *(spread(means[name].feature, means[name].sd) for name in names)],
        [f"{PLUS_MINUS} of one", "", *(spread(means[name].feature, means[name].std) for name in names)],
    ]
    left_out = [row for row in range(len(table)) if not kept[row]]
    caption = "One row a stroke. SD: standard deviation between strokes. "
    caption += (
        f"{PLUS_MINUS} of one: what the track's own bands say of a single stroke, one standard deviation."
    )
    if left_out:
        caption += " Grey: left out of all averages, for the reason beside its number."
    return sortable_table(key, caption, columns, rows, foot, muted=left_out)


def _stroke_row(table: StrokeTable, names: Sequence[str], row: int, kept: bool) -> list[str]:
    why = table.reason("in_averages")[row] if "in_averages" in table else ""
    head = value_cell(row + 1.0, str(row + 1))
    if not kept:
        head += f' <span class="mark">{escape(why or "left out")}</span>'
    start = float(table["catch_time_s"][row]) if "catch_time_s" in table else math.nan
    cells = [head, value_cell(start, fixed(start, 2))]
    for name in names:
        value = float(table[name][row])
        cell = value_cell(value, shown(feature_of(name), value))
        reason = table.reason(name)[row]
        cells.append(
            f'<span title="{escape(reason)}">{cell}</span>' if math.isnan(value) and reason else cell
        )
    return cells


def averages_table(
    key: str, caption: str, found: Iterable[Average], targets: dict[str, str] | None = None
) -> str:
    """A row a number: mean, how well it is known, SD between strokes, range; with targets what others published."""
    columns = [
        Column("number"),
        Column("unit"),
        Column("mean"),
        Column(
            PLUS_MINUS,
            meaning="One standard deviation of the mean: the track's bands, and the scatter of strokes.",
        ),
        Column("SD", meaning="Standard deviation between strokes."),
        Column("least"),
        Column("largest"),
        Column("strokes", meaning="How many strokes have this number."),
    ]
    if targets:
        columns.append(Column("published"))
    rows, muted = [], []
    for row, one in enumerate(found):
        cells = [link(one.feature.name, one.feature.label), escape(unit_of(one.feature))]
        if not one.count:
            muted.append(row)
            cells += [f'<span class="why">{escape(one.reason)}</span>', *[""] * 4, "0"]
        else:
            cells += [
                _value(one, one.mean),
                spread(one.feature, one.uncertainty),
                spread(one.feature, one.sd),
            ]
            cells += [_value(one, one.low), _value(one, one.high), value_cell(one.count, str(one.count))]
        if targets:
            cells.append(targets.get(one.feature.name, ""))
        rows.append(cells)
    return sortable_table(key, caption, columns, rows, muted=muted)


def sides_table(key: str, averages: dict[str, Average]) -> str:
    """Right and left side by side with their difference; empty where no number has two sides."""
    rows = []
    for name, right in averages.items():
        left = averages.get(f"l_{name.removeprefix('r_')}")
        if not name.startswith("r_") or left is None or not (right.count or left.count):
            continue
        label = right.feature.label.partition(",")[0]
        between = difference(left, right)
        rows.append(
            [
                link(name, label),
                escape(unit_of(right.feature)),
                _value(right, right.mean),
                _value(left, left.mean),
                value_cell(between.value, shown(right.feature, between.value, signed=True)),
                spread(right.feature, between.uncertainty),
                beyond_words(between.beyond),
            ]
        )
    if not rows:
        return ""
    columns = [
        Column("number"),
        Column("unit"),
        Column("right", "port"),
        Column("left", "starboard"),
        Column("right − left"),
        Column(PLUS_MINUS, meaning="One standard deviation of the difference."),
        Column(
            "beyond both uncertainties", meaning="Larger than 1.96 standard deviations of the difference."
        ),
    ]
    caption = (
        "Means over the strokes. The rower faces the stern: the right hand holds the port oar, the left hand the "
        "starboard oar."
    )
    return sortable_table(key, caption, columns, rows)


def beyond_words(beyond: bool | None) -> str:
    """`yes`, `no`, or that it cannot be said."""
    if beyond is None:
        return '<span class="mark">not known</span>'
    return "<b>yes</b>" if beyond else "no"


def _value(one: Average, value: float) -> str:
    return value_cell(value * one.feature.shown_scale, shown(one.feature, value))
