"""The summary sentences and key figures of a movement's report."""

from __future__ import annotations

from html import escape

from oarlock.movement.movement import Movement
from oarlock.movement.ranges import BAND_95, MotionRange
from oarlock.report import KeyFigure, fixed

MOST_SENTENCES = 3


def sentences(movement: Movement) -> list[str]:
    """Sentences as markup: what repeats, the largest ranges, and certain differences of the sides."""
    found: list[str] = []
    for one in movement.repetitions[:2]:
        spread = f", SD {fixed(float(one.durations_s.std(ddof=1)), 2)} s" if one.count > 1 else ""
        found.append(
            f"The movement repeats from {one.begins_s[0]:.0f} to {one.begins_s[-1]:.0f} s: <b>{one.count} cycles of "
            f"{fixed(one.period_s, 2)} s</b>{spread} ({fixed(60.0 / one.period_s, 0)} per minute)."
        )
    largest = sorted(movement.ranges.values(), key=lambda one: -one.range_deg)[:MOST_SENTENCES]
    texts = [f"{escape(plain(one.name))} {_span(one)}" for one in largest]
    found.append(f"Largest ranges: {'; '.join(texts)}.")
    certain = sorted((one for one in movement.sides if one.certain), key=lambda one: -abs(one.difference_deg))
    for side in certain[:MOST_SENTENCES]:
        larger = "right" if side.difference_deg > 0 else "left"
        found.append(
            f"{escape(plain(side.name)).capitalize()} has a larger range on the {larger}: "
            f"{fixed(side.right.range_deg, 0)}° right, {fixed(side.left.range_deg, 0)}° left "
            f"(difference {fixed(abs(side.difference_deg), 0)} ± {fixed(BAND_95 * side.std_deg, 0)}°)."
        )
    return found


def key_figures(movement: Movement) -> list[KeyFigure]:
    """Number and duration of the cycles; nothing if the movement does not repeat."""
    main = movement.main
    if main is None:
        return []
    return [
        KeyFigure("cycles", str(main.count), f"{main.begins_s[0]:.0f} to {main.begins_s[-1]:.0f} s"),
        KeyFigure("cycle", f"{fixed(main.period_s, 2)} s", f"{fixed(60.0 / main.period_s, 0)} per minute"),
    ]


def plain(name: str) -> str:
    """The name of an angle for people."""
    return name.replace("_", " ")


def _span(one: MotionRange) -> str:
    return f"{fixed(one.lowest_deg, 0)} to {fixed(one.highest_deg, 0)}°"
