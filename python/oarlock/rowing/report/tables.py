"""The strokes one by one, and the numbers of the piece, as tables."""

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
    "peak after, of the drive time": "peak_position",
}
DASH = "\N{EN DASH}"


def link(name: str, label: str) -> str:
    """A label that leads to its definition."""
    return (
        f'<a class="term" href="#{anchor(name)}">{escape(label)}</a>' if name in FEATURES else escape(label)
    )


def stroke_label(row: int) -> str:
    """What a stroke is called in the player, as `oarlock.rowing.stroke_marks` names it."""
    return f"stroke {row + 1}"


def anchor(name: str) -> str:
    """Where a number is explained in the page."""
    return f"def-{name.replace('_', '-')}"


def strokes_table(piece: Piece, key: str, played: bool) -> str:
    """A row a stroke, sortable; below it means, scatter and what the track's bands say of one stroke.

    Where the player shows this piece (`played`), numbers of strokes that it can repeat lead there.
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
        f"One row a stroke. SD: how much strokes differ from each other. {PLUS_MINUS} of one stroke: how "
        "exactly a single one was measured (one standard deviation)."
    )
    if left_out:
        caption += " Grey: left out of all averages, for the reason beside its number."
    return sortable_table(key, caption, columns, rows, foot, muted=left_out)


def _stroke_row(table: StrokeTable, names: Sequence[str], row: int, kept: bool, loops: bool) -> list[str]:
    number = str(row + 1)
    if loops:
        number = f'<a class="term" href="#moving" data-stroke="{stroke_label(row)}">{row + 1}</a>'
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
    """A row a number: mean, how well it is known, SD between strokes, range; beside it what others published.

    Averages that no stroke has are left to `unknown_list`.
    """
    found = [one for one in found if one.known]
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
        Column("strokes", meaning="How many strokes that count have this number."),
    ]
    columns += [Column("published")] if published else []
    rows = [
        [*_average_cells(one), *([published.get(one.feature.name, "")] if published else [])] for one in found
    ]
    return sortable_table(key, caption, columns, rows)


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
    """What no stroke tells, by reason; "" where all is known."""
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
    """What legs, trunk and arms do for the handle, a column each; "" where nothing is known of them."""
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
    caption = (
        f"What each does for the handle in the drive{whose}; small: the standard deviation between strokes."
    )
    return f'<div class="shares">{plain_table(key, caption, ["in the drive", "unit", *parts], rows)}</div>'


def sides_table(key: str, piece: Piece) -> str:
    """Right and left side by side with their difference; empty where no number has two sides."""
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
            "beyond both uncertainties", meaning="Larger than 1.96 standard deviations of the difference."
        ),
    ]
    caption = (
        f"Means over the strokes; small: SD between strokes. {PLUS_MINUS}: one standard deviation of the "
        "difference; beyond both uncertainties: larger than chance explains (95 %). The rower faces the "
        "stern: the right hand holds the port oar, the left hand the starboard oar."
    )
    if piece.track.provenance.get("nominal_mounts"):
        caption += (
            " Sensors were not calibrated: how they sit may make differences of the arms, of some degrees."
        )
    return sortable_table(key, caption, columns, rows)


def beyond_words(beyond: bool | None) -> str:
    """`yes`, `no`, or that it cannot be said."""
    if beyond is None:
        return '<span class="mark">not known</span>'
    return "<b>yes</b>" if beyond else "no"


def _with_scatter(one: Average) -> str:
    return f'{_value(one, one.over.mean)} <span class="spread">SD {spread(one.feature, one.over.sd)}</span>'


def _value(one: Average, value: float) -> str:
    return value_cell(value * one.feature.shown_scale, shown(one.feature, value))
