"""Tables of a rower's report: single strokes, means, legs-trunk-arms, right and left; and which means have no ±."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from oarlock.report import Column, fixed, plain_table, sortable_table, value_cell
from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.findings.find import least
from oarlock.rowing.report.averages import Average, Difference, feature_of
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.shown import PLUS_MINUS, apart, joined_unit, shown, spread, unit_of
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.statistics import NORMAL_95

_OF_UNITS = ("_lean_rad", "elbow", "shoulder", "arm_plane", "forearm")
"""Parts of the names of angles that inertial units measure. A swing is a change of an angle, in which a constant
error of a mount cancels; encoders measure oars and seat."""
NOT_CALIBRATED = '<span class="mark">not calibrated</span>'


def is_uncalibrated(piece: Counted, name: str) -> bool:
    """Whether this number is an angle of a unit that was not calibrated."""
    nominal = isinstance(piece, ReportPiece) and bool(piece.track.provenance.get("nominal_mounts"))
    return nominal and any(part in name for part in _OF_UNITS)


def about(found: Average) -> str:
    """A mean without the decimals that the error of a mount makes meaningless: `about −27°`."""
    return f"about {fixed(found.feature.shown_scale * found.over.mean, 0)}{joined_unit(found.feature)}"


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
_NEVER_ZERO = ("boat_peak_deceleration_m_s2",)
"""Numbers with a sign that are not zero by nature; those without a sign are sizes, which are not either."""
_UNCLEAR = 0.5
"""A size of which \N{PLUS-MINUS SIGN} is a larger share is marked."""


def link(name: str, label: str) -> str:
    """A label with a link to its definition."""
    return (
        f'<a class="term" href="#{anchor(name)}">{escape(label)}</a>' if name in FEATURES else escape(label)
    )


def anchor(name: str) -> str:
    """Anchor of the definition of a number in the page."""
    return f"def-{name.replace('_', '-')}"


def strokes_table(piece: ReportPiece, key: str, played: bool) -> str:
    """One row per stroke, sortable; below it mean, SD and the 95 % interval of one stroke.

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
        [
            f"{PLUS_MINUS} of one stroke",
            "",
            *(
                NOT_CALIBRATED
                if is_uncalibrated(piece, one.feature.name)
                else spread(one.feature, NORMAL_95 * one.over.std)
                for one in means
            ),
        ],
    ]
    left_out = [row for row in range(len(table)) if not kept[row]]
    caption = (
        f"One row a stroke. SD: standard deviation between strokes. {PLUS_MINUS} of one stroke: "
        "half of the 95 % interval of a single value."
    )
    if left_out:
        caption += f" Grey: not in averages, with the reason beside the number: {which_left_out(piece)}."
    return sortable_table(key, caption, columns, rows, foot, muted=left_out)


def which_left_out(piece: Counted) -> str:
    """Which strokes count in no average, and why: "stroke 1 (first stroke of the piece)"; "" if all count."""
    reasons: dict[str, list[str]] = {}
    for row in np.flatnonzero(~piece.counted):
        reasons.setdefault(piece.table.reason("in_averages")[row], []).append(str(row + 1))
    return "; ".join(
        f"{'stroke' if len(rows) == 1 else 'strokes'} {', '.join(rows)} ({reason})"
        for reason, rows in reasons.items()
    )


def _stroke_row(table: StrokeTable, names: Sequence[str], row: int, kept: bool, loops: bool) -> list[str]:
    number = str(row + 1)
    if loops:
        number = f'<a class="term" href="#moving" data-stroke="stroke {row + 1}">{row + 1}</a>'
    head = f'<data value="{row + 1}">{number}</data>'
    if not kept:
        head += f' <span class="mark">{escape(table.reason("in_averages")[row])}</span>'
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


def averages_table(
    key: str, caption: str, piece: ReportPiece, found: Iterable[Average], published: Mapping[str, str]
) -> str:
    """One row per number of a piece: mean, its 95 % interval, SD between strokes, range, published targets.

    Numbers that no stroke has are in `unknown_list`.
    """
    found = [one for one in found if one.known]
    columns = [
        Column("number"),
        Column("unit"),
        Column("mean"),
        Column(
            PLUS_MINUS,
            meaning="Half of the 95 % interval of the mean, from the track's bands and the scatter of strokes.",
        ),
        Column("SD", meaning="Standard deviation between strokes."),
        Column("least"),
        Column("largest"),
        Column("strokes", meaning="Number of counted strokes with this number."),
    ]
    columns += [Column("published")] if published else []
    rows = [
        [*_average_cells(piece, one), *([published.get(one.feature.name, "")] if published else [])]
        for one in found
    ]
    return sortable_table(key, caption, columns, rows, style="stacked")


def _average_cells(piece: ReportPiece, one: Average) -> list[str]:
    over, mean = one.over, _value(one, one.over.mean)
    half = (
        NOT_CALIBRATED if is_uncalibrated(piece, one.feature.name) else escape(spread(one.feature, one.half))
    )
    # a size that is not zero by nature
    has_size = not one.feature.sign or one.feature.name in _NEVER_ZERO
    if has_size and one.half > _UNCLEAR * abs(over.mean):
        mean, half = f'<span class="mark">{mean}</span>', f'{half} <span class="mark">not clear</span>'
    return [
        link(one.feature.name, one.feature.label),
        escape(unit_of(one.feature)),
        mean,
        half,
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
    listed = f'<details><summary>Not known, and why</summary><ul class="notes">{items}</ul></details>'
    return listed if items else ""


def shares_table(key: str, piece: ReportPiece) -> str:
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
    caption = f"Contributions to the handle's motion in the drive{whose}; small: SD between strokes."
    return f'<div class="shares">{plain_table(key, caption, ["in the drive", "unit", *parts], rows)}</div>'


def sides_table(key: str, piece: ReportPiece) -> str:
    """Right and left with their difference; empty if no number has two sides."""
    rows = []
    for name, mean in piece.sides.items():
        right, left = (piece.averages[f"{side}_{name}"] for side in "rl")
        feature, value = right.feature, mean.over.mean
        # Strokes of which only one side is known are in one mean and in no difference.
        paired = right.over.count == left.over.count == mean.over.count
        told = apart(feature, right.over.mean, left.over.mean) if paired else value
        between = Difference(feature, value, mean.uncertainty, told)
        head = [link(feature.name, feature.label.rpartition(",")[0]), escape(unit_of(feature))]
        unsure = is_uncalibrated(piece, name)
        judged = [NOT_CALIBRATED, NOT_KNOWN] if unsure else [spread(feature, between.half), verdict(between)]
        size = value_cell(told, shown(feature, told, signed=True))
        rows.append([*head, _with_scatter(right), _with_scatter(left), size, *judged])
    if not rows:
        return ""
    columns = [
        Column("number"),
        Column("unit"),
        Column("right", "port"),
        Column("left", "starboard"),
        Column("right − left", meaning="Of the two shown means."),
        Column(PLUS_MINUS, meaning="Half of the 95 % interval of the difference."),
        Column("verdict", meaning=VERDICT),
    ]
    whose = f"{piece.name}. " if piece.name else ""
    caption = (
        f"{whose}Means over the strokes; small: SD between strokes. {PLUS_MINUS}: half of the 95 % interval "
        "of the difference. It contains the zeros of oar encoders, which cancel in an arc; encoders are assumed to "
        "have no error of scale. The rower faces the stern: the right hand holds the port oar, the left hand the "
        "starboard oar."
    )
    if piece.track.provenance.get("nominal_mounts"):
        caption += (
            " Sensors were not calibrated: mounts may cause differences of several degrees between the arms."
        )
    return sortable_table(key, caption, columns, rows, style="stacked")


VERDICT = "Clear: larger than its 95 % interval. Small: below the smallest size that matters."
NOT_KNOWN = '<span class="mark">not known</span>'


def verdict(between: Difference) -> str:
    """`clear`, `clear, but small`, `not clear` or `not known`."""
    if between.beyond is None:
        return NOT_KNOWN
    if not between.beyond:
        return "not clear"
    small = abs(between.told) <= least(between.feature)
    return "clear, but small" if small else "<b>clear</b>"


def _with_scatter(one: Average) -> str:
    return f'{_value(one, one.over.mean)} <span class="spread">SD {spread(one.feature, one.over.sd)}</span>'


def _value(one: Average, value: float) -> str:
    return value_cell(value * one.feature.shown_scale, shown(one.feature, value))
