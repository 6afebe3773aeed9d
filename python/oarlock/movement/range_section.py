"""The section of a movement's report on ranges of motion: what was measured, and apart what was not, with reasons."""

from __future__ import annotations

from html import escape
from math import isfinite

from oarlock.movement.movement import Movement
from oarlock.movement.ranges import WELL_SHARE, MotionRange
from oarlock.movement.words import plain
from oarlock.report import Column, fixed, plain_table, sortable_table, value_cell
from oarlock.report.viewer.sides import side_of

LEAST_MOVEMENT_DEG = 5.0
"""Angles that move less are grey, and not drawn over cycles."""
STYLE = """@media (max-width: 560px) { :is(#ranges-table, #apart-table) th { white-space: normal; } }
#checked-table :is(th, td) { white-space: normal; overflow-wrap: normal; padding-inline: .3rem; min-width: 0; }
#checked-caption span { position: static; max-width: none; }"""
HUMAN = {
    "elbow_flexion": "146° of elbow flexion",
    "elbow_pronation": "80° of pronation and 87° of supination",
}
"""Mean active range of the dominant arm of 352 healthy adults (Zwerus et al. 2017)."""
HUMAN_SOURCE = (
    "Zwerus et al. 2017, Normative values and affecting factors for the elbow range of motion, "
    "Shoulder &amp; Elbow 11(3), doi 10.1177/1758573217728711"
)


def ranges_markup(movement: Movement) -> str:
    """Both tables, and what people usually reach."""
    well = [one for one in movement.shown.values() if one.well_measured]
    apart = [one for one in movement.shown.values() if not one.well_measured]
    return (
        (_measured(movement, well) if well else "")
        + (_apart(movement, apart) if apart else "")
        + _usual(movement)
    )


def _measured(movement: Movement, well: list[MotionRange]) -> str:
    meaning = "mean over the cycles" if movement.in_cycles else "largest minus smallest value"
    heads: list[Column] = [Column("angle"), Column(_name(movement), "deg", meaning), Column("±", "deg")]
    if movement.in_cycles:
        heads.append(Column("SD", "deg", "of the range between cycles"))
    heads += [Column("smallest", "deg"), Column("largest", "deg")]
    rows: list[list[str]] = []
    muted = [k for k, one in enumerate(well) if one.range_deg < LEAST_MOVEMENT_DEG]
    for one in well:
        whole = movement.ranges[one.name]
        values = [one.range_deg, one.half_deg]
        values += [one.between_deg] if movement.in_cycles else []
        values += [whole.lowest_deg, whole.highest_deg]
        rows.append([_head(movement, one), *(value_cell(v, fixed(v, 1)) for v in values)])
    return sortable_table("ranges", _caption(movement), heads, rows, muted=muted, style="stacked")


def _apart(movement: Movement, apart: list[MotionRange]) -> str:
    rows = [
        [
            _head(movement, one),
            f"{fixed(one.range_deg, 1)} ± {fixed(one.half_deg, 1)}",
            fixed(one.range_deg + one.half_deg, 0),
        ]
        for one in apart
    ]
    why = (
        f"Half of the 95 % interval is more than {100.0 * WELL_SHARE:g} % of the range: a small movement, or one "
        "that the sensors see badly, such as a turn about the vertical, which only magnetometers fix."
    )
    if movement.nominal:
        why += (
            " The sensors were not calibrated: if one sits 5° off, up to 9 % (sin 5°) of a large movement appears in "
            "the other angles of the same segment. A calibration session (above: Next) measures how each sensor sits."
        )
    heads: list[str | Column] = ["angle", Column(_name(movement), "deg"), Column("at most", "deg")]
    return f'<h3 id="ranges-apart">Not measured well enough</h3>{plain_table("apart", why, heads, rows)}'


def _caption(movement: Movement) -> str:
    parts = []
    if movement.in_cycles:
        parts.append("Range: mean over the cycles. Smallest and largest: of all counted time.")
    if any(isfinite(one.half_deg) for one in movement.shown.values()):
        parts.append(
            "±: half of the 95 % interval of the range, an upper limit: errors that both ends share cancel, but the "
            "track does not record how they are related."
        )
    if movement.nominal:
        parts.append("Errors of uncalibrated mounts are not in it.")
    if any(one.well_measured and one.range_deg < LEAST_MOVEMENT_DEG for one in movement.shown.values()):
        parts.append(f"Grey: less than {LEAST_MOVEMENT_DEG:g}°.")
    return " ".join(parts)


def _usual(movement: Movement) -> str:
    """What healthy adults reach, for the elbows of a body."""
    stems = [side_of(name.partition(" ")[0]) for name in movement.ranges]
    reached = [words for stem, words in HUMAN.items() if any(side and stem == one for side, one in stems)]
    if not reached:
        return ""
    return (
        f'<p class="hint">Healthy adults reach {", ".join(reached)} on average ({HUMAN_SOURCE}). A movement need '
        "not use all of it.</p>"
    )


def _name(movement: Movement) -> str:
    return "range in a cycle" if movement.in_cycles else "range"


def _head(movement: Movement, one: MotionRange) -> str:
    label = next(angle.label for angle in movement.angles if angle.name == one.name)
    return f'<span title="{escape(label)}">{escape(plain(one.name))}</span>'
