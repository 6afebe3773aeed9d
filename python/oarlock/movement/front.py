"""The front of the report of any body: what repeats, the largest ranges, sides that differ, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from oarlock.movement.checked import checked_markup
from oarlock.movement.cycles import cycle_courses
from oarlock.movement.evenness import Wander, changes, wanderings
from oarlock.movement.movement import Movement
from oarlock.movement.ranges import SideDifference
from oarlock.movement.words import (
    CYCLE,
    counts_from,
    key_figures,
    measured,
    named,
    plain,
    repeats,
    sized,
)
from oarlock.report import Course, Front, Point, Sourced, fixed

SIDES = "Range on the right minus range on the left; named if above 2° and outside its 95 % interval."
CHANGES = (
    "Last third of the cycles minus first third, ± its interval, which controls chance over all numbers."
)
WANDERS = (
    "The middle is the mean of an angle over a cycle. It wanders by its largest minus its smallest value. "
    "Above: last third of the cycles minus first third, ± its interval."
)
SQRT_2 = float(np.sqrt(2.0))
COMMANDS = (
    (
        "Print the steps of a calibration session",
        "oarlock calibrate session --model {model} --write-plan plan.toml",
    ),
    ("Calibrate from its recording", "oarlock calibrate session SESSION --model {model} --out cal.toml"),
    ("Track with it", "oarlock track RECORDING --model {model} --calibration cal.toml --out again"),
)
UNEVEN = 0.1
"""Share of the mean by which durations of cycles scatter before it is named."""
MOST_CURVES = 3


def front_of(movement: Movement) -> Front:
    """The front of a movement."""
    return Front(
        did=" ".join(filter(None, [*repeats(movement), counts_from(movement)])),
        points=[*_sides(movement), *_changes(movement), *_wanderings(movement), *_rhythm(movement)],
        quiet=_quiet(movement),
        remark=_drifting(movement),
        checked=checked_markup(movement),
        next_step=_next_step(movement),
        commands=_commands(movement),
        figures=key_figures(movement),
        course=_course(movement),
    )


def _quiet(movement: Movement) -> str:
    """What was compared, and from which size on a difference would have shown."""
    shown = []
    compared = changes(movement)
    if compared:
        sizes = " or ".join(f"{sized(one, one.least)} of the {named(one)}" for one in compared[:2])
        shown.append(f"From the first to the last third of the cycles, a change above {sizes} would show.")
    elif movement.main is not None:
        shown.append(f"{movement.main.count} cycles are too few to compare the first with the last third.")
    if movement.sides:
        most = max(movement.sides, key=lambda one: one.limit_deg)
        shown.append(
            f"Right and left: a difference above {fixed(most.limit_deg, 0)}° of any range would show."
        )
    return " ".join(["Nothing that this recording can show.", *shown])


def _changes(movement: Movement) -> list[Point]:
    found = []
    for one in changes(movement):
        if not one.certain:
            continue
        sign = "more" if one.difference > 0.0 else "less"
        size = sized(one, abs(one.difference))
        text = f"In the last third of the cycles the {named(one)} is {size} {sign} than in the first: "
        text += f"{sized(one, one.last)} instead of {sized(one, one.first)}."
        found.append(Point("Over the cycles", text, f"{size} ± {sized(one, one.limit)}", meaning=CHANGES))
    return found


def _wanderings(movement: Movement) -> list[Point]:
    """One finding for all angles whose middle wanders by more than their uncertainty: a cause is likely common."""
    beyond = [one for one in wanderings(movement) if one.certain and one.beyond]
    if not beyond:
        return []
    allowed = beyond[0].limit_deg
    text = f"{_wandered(movement, beyond)}. This is drift of the estimate or a change of posture"
    text += f": the uncertainty allows only {fixed(allowed, 0)}°" if np.isfinite(allowed) else ""
    advice = Sourced(
        "Hold the same still posture at the beginning and at the end: the angle that differs drifts."
    )
    return [Point("Drift", f"{text}.", f"{fixed(beyond[0].span_deg, 0)}°", advice=advice, meaning=WANDERS)]


def _drifting(movement: Movement) -> str:
    """Angles whose middle wanders by no more than their uncertainty allows, in a sentence."""
    within = [one for one in wanderings(movement) if one.certain and not one.beyond]
    if not within:
        return ""
    good = {one.name for one in measured(movement)}
    use = "Of these angles use the range in a cycle only."
    if not good & {one.angle for one in within}:
        use = "Do not use these angles of this recording."
    return (
        f"{_wandered(movement, within)}. Drift of the estimate explains that: the uncertainty allows up to "
        f"{fixed(within[0].limit_deg, 0)}°. {use}"
    )


def _wandered(movement: Movement, angles: Sequence[Wander]) -> str:
    main = movement.main
    took = 0.0 if main is None else float(main.begins_s[-1] - main.begins_s[0])
    first, *others = angles
    text = f"The middle of {plain(first.angle)} wandered by {fixed(first.span_deg, 0)}° in {fixed(took, 0)} s"
    return text + "".join(f", that of {plain(one.angle)} by {fixed(one.span_deg, 0)}°" for one in others)


def _next_step(movement: Movement) -> str:
    """Calibrate first, then record again, with the change that would show."""
    best = [one for one in measured(movement)[:2] if np.isfinite(one.half_deg)]
    sizes = " or ".join(f"{ceil(SQRT_2 * one.half_deg)}° of the range of {plain(one.name)}" for one in best)
    would = f" Between two calibrated recordings a change above {sizes} would show." if sizes else ""
    if not movement.nominal:
        return f"Record the same movement again to see a change.{would}"
    return f"Calibrate the sensors first (two minutes), then record the same movement again.{would}"


def _commands(movement: Movement) -> list[tuple[str, str]]:
    """A session calibrates any body; `calibrate motion` needs closed loops."""
    model = str(movement.track.provenance.get("model", "MODEL"))
    return [(name, one.format(model=model)) for name, one in COMMANDS] if movement.nominal else []


def _sides(movement: Movement) -> list[Point]:
    certain = sorted((one for one in movement.sides if one.certain), key=lambda one: -abs(one.difference_deg))
    return [_side(one) for one in certain]


def _side(one: SideDifference) -> Point:
    larger = "right" if one.difference_deg > 0 else "left"
    right, left = (fixed(side.range_deg, 0) for side in (one.right, one.left))
    return Point(
        "Right and left",
        f"{plain(one.name).capitalize()} has a larger range on the {larger}: {right}° right, {left}° left.",
        f"{fixed(abs(one.difference_deg), 0)} ± {fixed(one.limit_deg, 0)}°",
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
