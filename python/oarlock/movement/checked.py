"""Builds the table of differences between cycles: what was compared, and which change would have shown."""

from __future__ import annotations

from html import escape
from math import isfinite

from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.evenness import LEAST_MOVEMENT_DEG, CycleChange, Wander, changes, wanderings
from oarlock.movement.words import named, placed, plain, signed, sized
from oarlock.report import Column, fixed, plain_table

CAPTION = (
    "Last third of {count} cycles minus first. A change above the third column would have been reported; chance alone "
    "reports anything in at most 5 % of recordings. The middle of an angle is its mean over a cycle; it is also "
    "reported if it wanders further than the uncertainty of the track allows (in brackets)."
)


def checked_markup(movement: MovementAnalysis) -> str:
    """The tables, one for each block; empty if all have too few cycles to compare thirds."""
    return "".join(_table(movement, block) for block in movement.blocks)


def _table(movement: MovementAnalysis, block: MovementBlock) -> str:
    compared, middles = changes(movement, block), wanderings(movement, block)
    if not compared:
        return ""
    allowed = "largest minus smallest middle, and how far the uncertainty of the track lets it wander"
    heads: list[str | Column] = ["what", "change", "would show above", Column("wanders (may)", "", allowed)]
    rows = [[escape(named(one)), *_change(one, one.least, one.certain), "–"] for one in compared]
    rows += [_wandered(one) for one in middles]
    caption = placed(movement, block) + CAPTION.format(count=block.repetition.count)
    key = f"checked-{block.number}" if movement.several else "checked"
    return plain_table(key, caption, heads, rows, style="stacked")


def _change(one: CycleChange, least: float, reported: bool) -> list[str]:
    found = signed(one)
    return [f"<b>{found}</b>" if reported else found, sized(one, least)]


def _wandered(one: Wander) -> list[str]:
    allowed = f" ({fixed(one.limit_deg, 0)}°)" if isfinite(one.limit_deg) else ""
    change = _change(one.change, max(one.change.least, LEAST_MOVEMENT_DEG), one.certain)
    return [f"middle of {escape(plain(one.angle))}", *change, f"{fixed(one.span_deg, 0)}°{allowed}"]
