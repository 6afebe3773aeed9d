"""The summary sentences and key figures of a movement's report."""

from __future__ import annotations

from math import isfinite

from oarlock.movement.movement import Movement
from oarlock.movement.ranges import BAND_95, MotionRange
from oarlock.report import KeyFigure, fixed
from oarlock.report.viewer.sides import side_of

MOST_NAMED = 4
CYCLE = "Mean time from one largest value of the leading angle to the next."
RANGE = "Largest minus smallest value of the angle over the whole track, with its 95 % interval."


def repeats(movement: Movement) -> list[str]:
    """What repeats, in sentences."""
    found = []
    for one in movement.repetitions[:2]:
        spread = f", SD {fixed(float(one.durations_s.std(ddof=1)), 2)} s" if one.count > 1 else ""
        found.append(
            f"The movement repeats from {one.begins_s[0]:.0f} to {one.begins_s[-1]:.0f} s: {one.count} cycles of "
            f"{fixed(one.period_s, 2)} s{spread} ({fixed(60.0 / one.period_s, 0)} per minute)."
        )
    return found


def key_figures(movement: Movement) -> list[KeyFigure]:
    """Number and duration of the cycles, if it repeats, and the largest ranges that exceed their 95 % interval."""
    found = []
    main = movement.main
    if main is not None:
        begin, end = main.begins_s[0], main.begins_s[-1]
        found += [
            KeyFigure("cycles", str(main.count), f"{begin:.0f} to {end:.0f} s"),
            KeyFigure(
                "cycle", f"{fixed(main.period_s, 2)} s", f"{fixed(60.0 / main.period_s, 0)} per minute", CYCLE
            ),
        ]
    sure = [one for one in movement.ranges.values() if not BAND_95 * one.range_std_deg > one.range_deg]
    for one in sorted(sure, key=lambda one: -one.range_deg)[:MOST_NAMED]:
        half = f"± {fixed(BAND_95 * one.range_std_deg, 1)}°" if isfinite(one.range_std_deg) else ""
        found.append(
            KeyFigure(
                plain(one.name),
                f"{fixed(one.range_deg, 0)}°",
                "; ".join(filter(None, (_span(one), half))),
                RANGE,
            )
        )
    return found


def plain(name: str) -> str:
    """The name of an angle for people: `right elbow flexion` of `elbow_flexion_r`."""
    joint, space, axis = name.partition(" ")
    side, stem = side_of(joint)
    return f"{side} {stem}{space}{axis}".strip().replace("_", " ")


def heading(movement: Movement) -> str | None:
    """What was done, for the title of a page; None without angles."""
    if movement.main is not None:
        return f"{movement.main.count} cycles of {plain(movement.main.lead)}"
    if not movement.ranges:
        return None
    most = max(movement.ranges.values(), key=lambda one: one.range_deg)
    return f"movement, most in {plain(most.name)}"


def _span(one: MotionRange) -> str:
    return f"{fixed(one.lowest_deg, 0)} to {fixed(one.highest_deg, 0)}°"
