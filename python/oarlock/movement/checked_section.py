"""The section of a movement's report on differences between its cycles: what was compared, and what would have shown."""

from __future__ import annotations

from html import escape
from math import isfinite

from oarlock.movement.evenness import LEAST_MOVEMENT_DEG, Change, Wander, changes, wanderings
from oarlock.movement.movement import Movement
from oarlock.movement.words import named, plain, signed, sized
from oarlock.report import Column, fixed, plain_table

CAPTION = (
    "First against last third of {count} cycles. A change above the last column would have been reported; chance alone reports "
    "one in 5 % of recordings. The middle of an angle is its mean over a cycle. Its second limit is how far the uncertainty of "
    "the track lets it wander."
)


def checked_markup(movement: Movement) -> str:
    """The table; empty if there are too few cycles to compare thirds."""
    compared, middles = changes(movement), wanderings(movement)
    main = movement.main
    if main is None or not compared:
        return ""
    rows = [*map(_changed, compared), *map(_wandered, middles)]
    heads: list[str | Column] = ["what", "found", "would show above"]
    return plain_table("checked", CAPTION.format(count=main.count), heads, rows)


def _changed(one: Change) -> list[str]:
    return [escape(named(one)), _marked(signed(one), one.certain), sized(one, one.least)]


def _wandered(one: Wander) -> list[str]:
    found = f"{signed(one.change)}, wandered by {fixed(one.span_deg, 1)}°"
    limits = [max(one.change.least, LEAST_MOVEMENT_DEG), max(one.limit_deg, LEAST_MOVEMENT_DEG)]
    texts = [f"{fixed(limit, 1)}°" for limit in limits if isfinite(limit)]
    return [f"middle of {escape(plain(one.angle))}", _marked(found, one.certain), ", ".join(texts)]


def _marked(text: str, certain: bool) -> str:
    return f"<b>{text}</b>" if certain else text
