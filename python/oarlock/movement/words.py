"""The summary sentences and key figures of a movement's report."""

from __future__ import annotations

from math import isfinite

from oarlock.movement.evenness import Change
from oarlock.movement.movement import Movement
from oarlock.movement.ranges import MotionRange
from oarlock.report import KeyFigure, fixed
from oarlock.report.viewer.sides import side_of

MOST_NAMED = 4
CYCLE = "Mean time from one largest value of the leading angle to the next."
RANGE = "Largest minus smallest value of the angle, with half of its 95 % interval."
RANGE_IN_CYCLE = (
    "Largest minus smallest value of the angle within a cycle, mean over the cycles; below it the mean smallest and "
    "largest value, and half of the 95 % interval of the range. An offset that stays the same cancels in a range."
)
MOUNTS = "The interval does not contain errors of the mounts: without calibration a sensor may sit several degrees off."


def counts_from(movement: Movement) -> str:
    """From when the numbers count, if the start is left out."""
    skipped = movement.start_s - float(movement.track.time_s[0])
    if skipped <= 0.0:
        return ""
    return f"Numbers count from {fixed(movement.start_s, 1)} s on: before, the estimate still settles."


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
    found += [_figure(movement, one) for one in measured(movement)[:MOST_NAMED]]
    return found


def measured(movement: Movement) -> list[MotionRange]:
    """The ranges that are measured well enough, the largest first."""
    sure = [one for one in movement.shown.values() if one.well_measured]
    return sorted(sure, key=lambda one: -one.range_deg)


def _figure(movement: Movement, one: MotionRange) -> KeyFigure:
    half = f"± {fixed(one.half_deg, 1)}°" if isfinite(one.half_deg) else ""
    if half and movement.nominal:
        half += ", mounts not calibrated"
    meaning = RANGE_IN_CYCLE if one.name in movement.in_cycles else RANGE
    if movement.nominal:
        meaning += f" {MOUNTS}"
    detail = "; ".join(filter(None, (_span(one), half)))
    return KeyFigure(plain(one.name), f"{fixed(one.range_deg, 0)}°", detail, meaning)


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
    most = max(measured(movement) or movement.ranges.values(), key=lambda one: one.range_deg)
    return f"movement, most in {plain(most.name)}"


def _span(one: MotionRange) -> str:
    return f"{fixed(one.lowest_deg, 0)} to {fixed(one.highest_deg, 0)}°"


def named(one: Change) -> str:
    """What a change compares, for people."""
    return f"range of {plain(one.angle)}" if one.angle else "cycle time"


def sized(one: Change, value: float) -> str:
    """A value in the unit of the change: `0.05 s`, `3.1°`."""
    return f"{fixed(value, 1)}°" if one.angle else f"{fixed(value, 2)} s"


def signed(one: Change) -> str:
    """The change with its sign."""
    return f"{'+' if one.difference >= 0.0 else ''}{sized(one, one.difference)}"
