"""The section of a movement's report on ranges of motion: what was measured, and apart what was not, with reasons."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite

from oarlock.movement.angles import UNDETERMINED
from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.ranges import LEAST_MOVEMENT_DEG, WELL_SHARE, WITHIN_DEG, MotionRange
from oarlock.movement.words import plain, titled, within
from oarlock.report import Column, fixed, plain_table, sortable_table, value_cell
from oarlock.report.viewer.sides import side_of

STYLE = """@media (max-width: 560px) { [id^="ranges"] th { white-space: normal; } }
#apart-table :is(th, td) { white-space: normal; }
[id^="checked"] :is(th, td) { white-space: normal; overflow-wrap: normal; padding-inline: .3rem; min-width: 0; }
[id^="checked"] > caption span { position: static; max-width: none; }"""
HUMAN = {
    "elbow_flexion": (146.0, "146° of elbow flexion"),
    "elbow_pronation": (167.0, "80° of pronation and 87° of supination"),
}
"""Mean active range of the dominant arm of 352 healthy adults, deg (Zwerus et al. 2017)."""
HUMAN_SOURCE = (
    "Zwerus et al. 2017, Normative values and affecting factors for the elbow range of motion, "
    "Shoulder &amp; Elbow 11(3), doi 10.1177/1758573217728711"
)
APART, MOST_OPEN = "Not measured well enough", 8
"""Heading of the ranges that are not, and how many are shown at once: a whole body has some thirty angles."""
TESTED_SHARE = 0.25
"""A movement tests an angle if it uses at least this share of what people reach."""


def ranges_markup(movement: MovementAnalysis) -> str:
    """The ranges that are measured well, of each block, those that are not, and what people usually reach."""
    if movement.several:
        first = f'<p class="hint">{_caption(movement)}</p>' + "".join(
            f"<h3>{escape(titled(block))}</h3>{_measured(movement, block, _well(block.ranges.values()))}"
            for block in movement.blocks
        )
        apart = [
            (block, one)
            for block, one in movement.block_ranges
            if not (one.well_measured or one.hardly_moved)
        ]
        return first + _apart(movement, apart) + _usual(movement)
    badly = [(block, one) for block, one in movement.block_ranges if not one.well_measured]
    return (
        _measured(movement, movement.main, _well(movement.shown)) + _apart(movement, badly) + _usual(movement)
    )


def _well(ranges: Iterable[MotionRange]) -> list[MotionRange]:
    return [one for one in ranges if one.well_measured]


def _measured(movement: MovementAnalysis, block: MovementBlock | None, well: list[MotionRange]) -> str:
    """A table; of several blocks with the ends of the cycles, else with those of all counted time."""
    if not well:
        return "<p>No angle was measured well in this block.</p>" if movement.several else ""
    meaning = "mean over the cycles" if block else "largest minus smallest value"
    heads: list[Column] = [Column("angle"), Column(_name(movement), "deg", meaning), Column("±", "deg")]
    if block:
        heads.append(Column("SD", "deg", "of the range between cycles"))
    heads += [Column("smallest", "deg"), Column("largest", "deg")]
    rows: list[list[str]] = []
    muted = [k for k, one in enumerate(well) if one.hardly_moved]
    for one in well:
        ends = movement.ends(one)
        values = [one.range_deg, one.half_deg, *([one.between_deg] if block else [])]
        values += [ends.lowest_deg, ends.highest_deg]
        rows.append([_head(movement, one), *(value_cell(v, fixed(v, 1)) for v in values)])
    key, caption = "ranges", _caption(movement)
    if movement.several and block:
        still = [one for one in block.ranges.values() if one.hardly_moved and not one.well_measured]
        names = ", ".join(f"{escape(plain(one.name))} {within(one)}" for one in still)
        key, caption = f"ranges-{block.number}", f"Hardly moved: {names}." if names else ""
    return sortable_table(key, caption, heads, rows, muted=muted, style="stacked")


def _apart(movement: MovementAnalysis, apart: Sequence[tuple[MovementBlock | None, MotionRange]]) -> str:
    if not apart:
        return ""
    rows = [
        [
            _head(movement, one),
            *([str(block.number)] if movement.several and block else []),
            *_limits(one),
            "the movement is small" if one.hardly_moved and one.doubt != UNDETERMINED else one.cause,
        ]
        for block, one in apart
    ]
    why = (
        f"Half of the 95 % interval is more than {100.0 * WELL_SHARE:g} % of the range, or single values of the "
        f"angle are less certain than ± {WITHIN_DEG:.0f}°, or it drifts, passes the limits of its joint, or is beside "
        "such a joint or unit. Where other angles change with it, errors of mounts and headings do not cancel."
    )
    if movement.nominal:
        why += (
            " The sensors were not calibrated: if one sits 5° off, up to 9 % (sin 5°) of a large movement appears in "
            "the other angles of the same segment. A calibration session (above: Next) measures how each sensor sits."
        )
    heads: list[str | Column] = ["angle", *(["block"] if movement.several else [])]
    heads += [Column(_name(movement), "deg"), Column("95 % upper limit", "deg"), "because"]
    table = plain_table("apart", why, heads, rows, style="stacked")
    if len(rows) <= MOST_OPEN:
        return f'<h3 id="ranges-apart">{APART}</h3>{table}'
    return f'<details class="help" id="ranges-apart"><summary>{APART}: {len(rows)} ranges</summary>{table}</details>'


def _limits(one: MotionRange) -> tuple[str, str]:
    """A range with half of its interval, and its upper limit; without numbers if they are not usable."""
    if one.doubt == UNDETERMINED:
        return "–", "–"
    return f"{fixed(one.range_deg, 1)} ± {fixed(one.half_deg, 1)}", fixed(one.range_deg + one.half_deg, 0)


def _caption(movement: MovementAnalysis) -> str:
    parts = []
    if movement.blocks and not movement.several:
        parts.append("Range: mean over the cycles. Smallest and largest: of all counted time.")
    if movement.several:
        parts.append("Range, smallest and largest: means over the cycles of this block.")
    if any(isfinite(one.half_deg) for one in movement.shown):
        parts.append(
            "±: half of the 95 % interval of the range. It contains errors of mounts and headings as far as they do "
            "not cancel between both ends, units that move with the skin, and the scatter between cycles."
        )
    if movement.nominal:
        parts.append("Errors of uncalibrated mounts may be larger.")
    if any(one.well_measured and one.hardly_moved for one in movement.shown):
        parts.append(f"Grey: less than {LEAST_MOVEMENT_DEG:g}°.")
    return " ".join(parts)


def _usual(movement: MovementAnalysis) -> str:
    """What healthy adults reach, for the angles that this recording tests."""
    tested = {
        stem
        for one in movement.shown
        for side, stem in [side_of(one.name.partition(" ")[0])]
        if side and one.well_measured and stem in HUMAN and one.range_deg >= TESTED_SHARE * HUMAN[stem][0]
    }
    reached = [words for stem, (_, words) in HUMAN.items() if stem in tested]
    if not reached:
        return ""
    return (
        f'<p class="hint">Healthy adults reach {", ".join(reached)} on average ({HUMAN_SOURCE}). A movement need '
        "not use all of it.</p>"
    )


def _name(movement: MovementAnalysis) -> str:
    return "range in a cycle" if movement.blocks else "range"


def _head(movement: MovementAnalysis, one: MotionRange) -> str:
    label = next(angle.label for angle in movement.angles if angle.name == one.name)
    return f'<span title="{escape(label)}">{escape(plain(one.name))}</span>'
