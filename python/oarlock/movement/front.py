"""The front of the report of any body: what repeats, the largest ranges, sides that differ, and what to do next."""

from __future__ import annotations

import numpy as np

from oarlock.movement.cycles import cycle_courses
from oarlock.movement.movement import Movement
from oarlock.movement.ranges import BAND_95, SideDifference
from oarlock.movement.words import CYCLE, key_figures, plain, repeats
from oarlock.report import Course, Front, Point, fixed

SIDES = "Range on the right minus range on the left; named if above 2° and outside its 95 % interval."
UNEVEN = 0.1
"""Share of the mean by which durations of cycles scatter before it is named."""
MOST_CURVES = 3


def front_of(movement: Movement) -> Front:
    """The front of a movement."""
    return Front(
        did=" ".join(repeats(movement)),
        points=[*_sides(movement), *_rhythm(movement)],
        quiet=_quiet(movement),
        next_step="Record the same movement again to see a change.",
        figures=key_figures(movement),
        course=_course(movement),
    )


def _quiet(movement: Movement) -> str:
    sides = "Right and left agree within their uncertainty. " if movement.sides else ""
    even = "The cycles are even. " if movement.main is not None else ""
    return f"Nothing. {sides}{even}".strip()


def _sides(movement: Movement) -> list[Point]:
    certain = sorted((one for one in movement.sides if one.certain), key=lambda one: -abs(one.difference_deg))
    return [_side(one) for one in certain]


def _side(one: SideDifference) -> Point:
    larger = "right" if one.difference_deg > 0 else "left"
    right, left = (fixed(side.range_deg, 0) for side in (one.right, one.left))
    return Point(
        "Right and left",
        f"{plain(one.name).capitalize()} has a larger range on the {larger}: {right}° right, {left}° left.",
        f"{fixed(abs(one.difference_deg), 0)} ± {fixed(BAND_95 * one.std_deg, 0)}°",
        meaning=SIDES,
    )


def _rhythm(movement: Movement) -> list[Point]:
    main = movement.main
    if main is None or main.count < 2:
        return []
    spread = float(main.durations_s.std(ddof=1))
    if spread < UNEVEN * main.period_s:
        return []
    text = f"The cycles are uneven: they take {fixed(float(main.durations_s.min()), 2)} to "
    text += f"{fixed(float(main.durations_s.max()), 2)} s."
    return [Point("Rhythm", text, f"SD {fixed(spread, 2)} s", meaning=CYCLE)]


def _course(movement: Movement) -> Course | None:
    """The angles that move most, over a cycle."""
    main = movement.main
    if main is None:
        return None
    moving = sorted(
        (angle for angle in movement.angles if angle.name in movement.in_cycles),
        key=lambda angle: -movement.in_cycles[angle.name].range_deg,
    )
    curves = {}
    for angle in moving[:MOST_CURVES]:
        courses = cycle_courses(movement.track.time_s, angle.value_deg, main.begins_s)
        mean, sd = courses.mean(axis=0), courses.std(axis=0, ddof=1)
        share = np.linspace(0.0, 100.0, len(mean))
        curves[plain(angle.name)] = (list(share), list(mean), list(mean - sd), list(mean + sd))
    return Course("Angles over a cycle", "deg", "% of the cycle", curves) if curves else None
