"""Tables of a rower's report: single strokes, means, legs-trunk-arms, right and left."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from oarlock.report import Column, fixed, plain_table, sortable_table, value_cell
from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.report.averages import Average, feature_of
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of
from oarlock.rowing.strokes.table import StrokeTable

FIRST_COLUMNS = (
    "rate_per_min",
    "drive_time_s",
    "rhythm",
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "handle_travel_m",
    "seat_travel_m",
    "catch_factor_s",
    "style_factor",
    "catch_lean_rad",
    "finish_lean_rad",
    "power_w",
    "peak_force_n",
)
"""Of the strokes table, where they are known; all columns are in strokes.csv."""

SHARES = {
    "part of the handle travel": "travel_m",
    "share of it": "share",
    "peak speed": "peak_speed_m_s",
    "time of the peak, share of the drive": "peak_position",
}
DASH = "\N{EN DASH}"


def link(name: str, label: str) -> str:
    """A label with a link to its definition."""
    return (
        f'<a class="term" href="#{anchor(name)}">{escape(label)}</a>' if name in FEATURES else escape(label)
    )


def anchor(name: str) -> str:
    """Anchor of the definition of a number in the page."""
    return f"def-{name.replace('_', '-')}"


def strokes_table(piece: Piece, key: str, played: bool) -> str:
    """One row per stroke, sortable; below it mean, SD and the standard deviation of one stroke.

    If the player shows this piece (`played`), stroke numbers link to it.
    """
    table, kept = piece.table, piece.counted
    names = [name for name in FIRST_COLUMNS if name in table and np.isfinite(table[name]).any()]
    features = [feature_of(name) for name in names]
    columns = [Column("stroke"), Column("at", "s", FEATURES["catch_time_s"].in_words)]
    columns += [Column(feature.label, unit_of(feature), feature.in_words) for feature in features]
    loops = np.isfinite(table["end_time_s"]) & played
    rows = [_stroke_row(table, names, row, bool(kept[row]), bool(loops[row])) for row in range(len(table))]
    means = [piece.averages[name] for name in names]
    foot = [
        ["mean", "", *(shown(one.feature, one.over.mean) for one in means)],
        ["SD", "", *(spread(one.feature, one.over.sd) for one in means)],
        [f"{PLUS_MINUS} of one stroke", "", *(spread(one.feature, one.over.std) for one in means)],
    ]
    left_out = [row for row in range(len(table)) if not kept[row]]
    caption = (
        f"One row a stroke. SD: standard deviation between strokes. {PLUS_MINUS} of one stroke: "
        "standard deviation of a single measured value."
    )
    if left_out:
        caption += " Grey: excluded from all averages, with the reason beside the number."
    return sortable_table(key, caption, columns, rows, foot, muted=left_out)


def _stroke_row(table: StrokeTable, names: Sequence[str], row: int, kept: bool, loops: bool) -> list[str]:
    number = str(row + 1)
    if loops:
        number = f'<a class="term" href="#moving" data-stroke="stroke {row + 1}">{row + 1}</a>'
    head = f'<data value="{row + 1}">{number}</data>'
    if not kept:
        head += f' <span class="mark">{escape(table.reason("in_averages")[row] or "left out")}</span>'
    start = float(table["catch_time_s"][row])
    cells = [head, value_cell(start, fixed(start, 2))]
    for name in names:
        value = float(table[name][row])
        cell = value_cell(value, shown(feature_of(name), value))
        reason = table.reason(name)[row]
        cells.append(
            f'<span title="{escape(reason)}">{cell}</span>' if math.isnan(value) and reason else cell
        )
    return cells


def averages_table(key: str, caption: str, found: Iterable[Average], published: Mapping[str, str]) -> str:
    """One row per number: mean, its standard deviation, SD between strokes, range, published targets.

    Numbers that no stroke has are in `unknown_list`.
    """
    found = [one for one in found if one.known]
    columns = [
        Column("number"),
        Column("unit"),
        Column("mean"),
        Column(
            PLUS_MINUS,
            meaning="Standard deviation of the mean, from the track's bands and the scatter of strokes.",
        ),
        Column("SD", meaning="Standard deviation between strokes."),
        Column("least"),
        Column("largest"),
        Column("strokes", meaning="Number of counted strokes with this number."),
    ]
    columns += [Column("published")] if published else []
    rows = [
        [*_average_cells(one), *([published.get(one.feature.name, "")] if published else [])] for one in found
    ]
    return sortable_table(key, caption, columns, rows, style="stacked")


def _average_cells(one: Average) -> list[str]:
    over = one.over
    return [
        link(one.feature.name, one.feature.label),
        escape(unit_of(one.feature)),
        _value(one, over.mean),
        spread(one.feature, one.uncertainty),
        spread(one.feature, over.sd),
        _value(one, over.least),
        _value(one, over.most),
        value_cell(over.count, str(over.count)),
    ]


def unknown_list(found: Iterable[Average]) -> str:
    """Numbers that no stroke has, by reason; "" if there are none."""
    reasons: dict[str, list[str]] = {}
    for one in found:
        if not one.known:
            reasons.setdefault(one.reason, []).append(link(one.feature.name, one.feature.label))
    items = "".join(f"<li>{escape(reason)}: {', '.join(names)}</li>" for reason, names in reasons.items())
    return (
        f'<details><summary>Not known, and why</summary><ul class="notes">{items}</ul></details>'
        if items
        else ""
    )


def shares_table(key: str, piece: Piece) -> str:
    """Contributions of legs, trunk and arms to the handle, one column each; "" if unknown."""
    parts = ("legs", "trunk", "arms")
    rows = []
    for words, ending in SHARES.items():
        found = [piece.averages.get(f"{part}_{ending}") for part in parts]
        if any(one is not None and one.known for one in found):
            unit = next(unit_of(one.feature) for one in found if one is not None)
            cells = [_with_scatter(one) if one is not None and one.known else DASH for one in found]
            rows.append([link(f"legs_{ending}", words), escape(unit), *cells])
    if not rows:
        return ""
    whose = f", {piece.name}" if piece.name else ""
    caption = f"Contributions to the handle's motion in the drive{whose}; small: standard deviation between strokes."
    return f'<div class="shares">{plain_table(key, caption, ["in the drive", "unit", *parts], rows)}</div>'


def sides_table(key: str, piece: Piece) -> str:
    """Right and left with their difference; empty if no number has two sides."""
    rows = []
    for name, apart in piece.sides.items():
        right, left = (piece.averages[f"{side}_{name}"] for side in "rl")
        rows.append(
            [
                link(right.feature.name, right.feature.label.rpartition(",")[0]),
                escape(unit_of(right.feature)),
                _with_scatter(right),
                _with_scatter(left),
                value_cell(apart.over.mean, shown(right.feature, apart.over.mean, signed=True)),
                spread(right.feature, apart.uncertainty),
                beyond_words(apart.beyond_zero),
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
            "exceeds both uncertainties", meaning="Larger than 1.96 standard deviations of the difference."
        ),
    ]
    caption = (
        f"{_whose(piece)}Means over the strokes; small: SD between strokes. {PLUS_MINUS}: one standard "
        "deviation of the difference; exceeds both uncertainties: statistically significant (95 %). The "
        "rower faces the stern: the right hand holds the port oar, the left hand the starboard oar."
    )
    if piece.track.provenance.get("nominal_mounts"):
        caption += (
            " Sensors were not calibrated: mounts may cause differences of several degrees between the arms."
        )
    return sortable_table(key, caption, columns, rows, style="stacked")


def _whose(piece: Piece) -> str:
    return f"{piece.name}. " if piece.name else ""


def beyond_words(beyond: bool | None) -> str:
    """`yes`, `no` or `not known`."""
    if beyond is None:
        return '<span class="mark">not known</span>'
    return "<b>yes</b>" if beyond else "no"


def _with_scatter(one: Average) -> str:
    return f'{_value(one, one.over.mean)} <span class="spread">SD {spread(one.feature, one.over.sd)}</span>'


def _value(one: Average, value: float) -> str:
    return value_cell(value * one.feature.shown_scale, shown(one.feature, value))
