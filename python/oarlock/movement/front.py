"""The front of the report of any body: what repeats, the largest ranges, sides that differ, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import ceil, isfinite

import numpy as np

from oarlock.model.shipped_files import model_names
from oarlock.movement.angles import CONTRADICTED, UNDETERMINED, UNRELIABLE, MovementAngle
from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.cycles import cycle_courses
from oarlock.movement.evenness import (
    LEAST_CYCLES,
    CycleChange,
    Wander,
    changes,
    wanderings,
)
from oarlock.movement.ranges import LEAST_MOVEMENT_DEG
from oarlock.movement.words import (
    CYCLE,
    counts_from,
    key_figures,
    measured,
    named,
    placed,
    plain,
    repeats,
    sized,
)
from oarlock.report import Column, Course, Front, Point, Sourced, fixed, plain_table
from oarlock.report.text import listing
from oarlock.tracking.notes import undetermined_units

THIRDS = "From the first to the last third of the cycles,"
NOTHING = "No difference was found."
SIDES = (
    "Range on the right minus range on the left; named if both are measured well, and it is above 2° and outside its "
    "95 % interval."
)
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
LARGE_DEG = 15.0
"""Range of an angle that a reader looks for, and misses if it is not measured well."""


def front_of(movement: MovementAnalysis) -> Front:
    """The front of a movement."""
    points = [
        point
        for block in movement.blocks
        for of in (_changes, _wanderings, _rhythm)
        for point in of(movement, block)
    ]
    name = str(movement.track.provenance.get("model", "MODEL"))
    model = name if name in model_names() else "model.toml"  # beside the page
    needed = movement.nominal or _sensors_step(movement) or _has(movement, UNDETERMINED)
    return Front(
        did=" ".join(filter(None, [*repeats(movement), counts_from(movement)])),
        points=[*_sides(movement), *points],
        quiet=_quiet(movement),
        remark=" ".join(filter(None, (_drifting(movement, block) for block in movement.blocks))),
        checked=checked_markup(movement),
        next_step=_next_step(movement),
        sensors_step=_sensors_step(movement),
        caution=_caution(movement),
        # A session calibrates any body; `calibrate motion` needs closed loops.
        commands=[(name, one.format(model=model)) for name, one in COMMANDS if needed],
        figures=key_figures(movement),
        course=_course(movement),
    )


def _quiet(movement: MovementAnalysis) -> str:
    """What was compared, and from which size on a difference would have shown."""
    shown = []
    for block in movement.blocks:
        compared = changes(movement, block)
        if compared:
            sizes = " or ".join(f"{sized(one, one.least)} of the {named(one)}" for one in compared[:2])
            shown.append(f"{placed(movement, block)}{THIRDS} a change above {sizes} would show.")
    few = [one.repetition.count for one in movement.blocks if one.repetition.count < LEAST_CYCLES]
    if few:
        counts = f"{few[0]}" if len(set(few)) == 1 else f"{min(few)} to {max(few)}"
        shown.append(
            f"{counts} whole cycles are too few to compare the first with the last third: that needs {LEAST_CYCLES} "
            f"({LEAST_CYCLES + 1} repetitions)."
        )
    limits = [one.limit_deg for _, one in movement.sides if one.well_measured and np.isfinite(one.limit_deg)]
    if limits:
        shown.append(f"Right and left: a difference above {fixed(max(limits), 0)}° of any range would show.")
    return " ".join([NOTHING if len(shown) > bool(few) else "", *shown]).strip()


def _changes(movement: MovementAnalysis, block: MovementBlock) -> list[Point]:
    found = []
    for one in changes(movement, block):
        if not one.certain:
            continue
        sign = "more" if one.difference > 0.0 else "less"
        size = sized(one, abs(one.difference))
        text = f"In the last third of the cycles the {named(one)} is {size} {sign} than in the first: "
        text += f"{sized(one, one.last)} instead of {sized(one, one.first)}."
        half = f"{size} ± {sized(one, one.limit)}"
        found.append(Point("Over the cycles", placed(movement, block) + text, half, meaning=CHANGES))
    return found


def _wanderings(movement: MovementAnalysis, block: MovementBlock) -> list[Point]:
    """One finding for all angles whose middle wanders by more than their uncertainty: a cause is likely common."""
    beyond = [one for one in wanderings(movement, block) if one.certain and one.beyond]
    if not beyond:
        return []
    allowed = beyond[0].limit_deg
    text = f"{placed(movement, block)}{_wandered(block, beyond)}. This is drift of the estimate or a change of posture"
    text += f": the uncertainty allows only {fixed(allowed, 0)}°" if np.isfinite(allowed) else ""
    advice = Sourced(
        "Hold the same still posture at the beginning and at the end: the angle that differs drifts."
    )
    return [Point("Drift", f"{text}.", f"{fixed(beyond[0].span_deg, 0)}°", advice=advice, meaning=WANDERS)]


def _drifting(movement: MovementAnalysis, block: MovementBlock) -> str:
    """Angles whose middle wanders by no more than their uncertainty allows, in a sentence."""
    within_limits = [one for one in wanderings(movement, block) if one.certain and not one.beyond]
    if not within_limits:
        return ""
    use = "Of these angles use the range in a cycle only."
    if not any(block.ranges[one.angle].is_narrow for one in within_limits):
        use = "Do not use these angles of this recording."
    return (
        f"{placed(movement, block)}{_wandered(block, within_limits)}. Drift of the estimate explains that: the "
        f"uncertainty allows up to {fixed(within_limits[0].limit_deg, 0)}°. {use}"
    )


def _wandered(block: MovementBlock, angles: Sequence[Wander]) -> str:
    begins_s = block.repetition.begins_s
    first, *others = angles
    took = fixed(float(begins_s[-1] - begins_s[0]), 0)
    text = f"The middle of {plain(first.angle)} wandered by {fixed(first.span_deg, 0)}° in {took} s"
    return text + "".join(f", that of {plain(one.angle)} by {fixed(one.span_deg, 0)}°" for one in others)


def _next_step(movement: MovementAnalysis) -> str:
    """Calibrate first, then record again: how often, what this shows, and the change that would show.

    Where joints contradict a unit, the recording may still be good. Where the heading of a unit is not determined, the
    same movement would not determine it either.
    """
    if _has(movement, CONTRADICTED):
        return "Correct segment or mount of the units that joints contradict, and track this recording again."
    if _has(movement, UNDETERMINED):
        units = listing(undetermined_units(movement.track.notes))
        return (
            f"Record a guided session, or the movement with the segment of {units} bending forward by 20°: this "
            "determines the heading of the mount."
        )
    known = [one for one in movement.shown if np.isfinite(one.half_deg) and not one.hardly_moved]
    best = {one.name: one for one in reversed(measured(known))}
    largest = sorted(best.values(), key=lambda one: -one.range_deg)[:2]
    sizes = " or ".join(
        f"{ceil(SQRT_2 * one.half_deg)}° of the range of {plain(one.name)}" for one in largest
    )
    would = f" Between two calibrated recordings a change above {sizes} would show." if sizes else ""
    counts = [block.repetition.count for block in movement.blocks]
    again = "the same movement again"
    if not counts or min(counts) < LEAST_CYCLES:
        again += (
            f", with {LEAST_CYCLES + 1} or more repetitions: then the first can be compared with the last"
        )
    if movement.nominal:
        return f"Calibrate the sensors first (two minutes), then record {again}.{would}"
    return f"Record {again}.{would}"


def _has(movement: MovementAnalysis, doubt: str) -> bool:
    return any(one.doubt == doubt for one in movement.shown)


def _caution(movement: MovementAnalysis) -> str:
    """That large movements are not measured well; "" if all are."""
    large = [one for one in movement.shown if one.range_deg > LARGE_DEG]
    poor = [one for one in large if not one.well_measured]
    if not poor:
        return ""
    names = ", ".join(plain(one.name) for one in poor[:MOST_CURVES])
    return f"{len(poor)} of {len(large)} angles with a range above {LARGE_DEG:.0f}° are not measured well: {names}."


def _sensors_step(movement: MovementAnalysis) -> str:
    """What narrows angles that are not measured well; without calibration the next step says it."""
    if movement.nominal or any(_has(movement, doubt) for doubt in UNRELIABLE) or not _caution(movement):
        return ""
    return (
        "Record a guided calibration session just before the movement (two minutes) and strap the units tightly: both "
        "narrow the ± of angles that are not measured well."
    )


def _sides(movement: MovementAnalysis) -> list[Point]:
    found = []
    certain = (found for found in movement.sides if found[1].certain)
    for block, one in sorted(certain, key=lambda found: -abs(found[1].difference_deg)):
        larger = "right" if one.difference_deg > 0 else "left"
        text = f"{placed(movement, block)}{plain(one.name).capitalize()} has a larger range on the {larger}: "
        text += f"{fixed(one.right.range_deg, 0)}° right, {fixed(one.left.range_deg, 0)}° left."
        size = f"{fixed(abs(one.difference_deg), 0)} ± {fixed(one.limit_deg, 0)}°"
        found.append(Point("Right and left", text, size, meaning=SIDES))
    return found


def _rhythm(movement: MovementAnalysis, block: MovementBlock) -> list[Point]:
    one = block.repetition
    spread = float(one.durations_s.std(ddof=1))
    if spread < UNEVEN * one.period_s:
        return []
    text = f"{placed(movement, block)}The cycles are uneven: they take {fixed(float(one.durations_s.min()), 2)} to "
    text += f"{fixed(float(one.durations_s.max()), 2)} s."
    return [Point("Rhythm", text, f"SD {fixed(spread, 2)} s", meaning=CYCLE)]


def _course(movement: MovementAnalysis) -> Course | None:
    """The angles that move most over a cycle; of several blocks the leading one of each."""
    curves: list[tuple[MovementBlock, MovementAngle]] = []
    for block in movement.blocks[:MOST_CURVES]:
        ranges = block.ranges
        moving = [one for one in block.angles if one.name in ranges and one.doubt not in UNRELIABLE]
        if movement.several:
            moving = [one for one in block.angles if one.name == block.repetition.lead]
        else:
            moving.sort(key=lambda one: -ranges[one.name].range_deg)
        curves += [(block, angle) for angle in moving[: 1 if movement.several else MOST_CURVES]]
    drawn = {}
    for block, angle in curves:
        courses = cycle_courses(movement.track.time_s, angle.value_deg, block.repetition.begins_s)
        mean, sd = courses.mean(axis=0), courses.std(axis=0, ddof=1)
        share = np.linspace(0.0, 100.0, len(mean))
        name = f"{block.number}: {plain(angle.name)}" if movement.several else plain(angle.name)
        drawn[name] = (list(share), list(mean), list(mean - sd), list(mean + sd))
    return Course("Angles over a cycle", "deg", "% of the cycle", drawn) if drawn else None


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
    for one in middles:
        may = f" ({fixed(one.limit_deg, 0)}°)" if isfinite(one.limit_deg) else ""
        change = _change(one.change, max(one.change.least, LEAST_MOVEMENT_DEG), one.certain)
        rows.append([f"middle of {escape(plain(one.angle))}", *change, f"{fixed(one.span_deg, 0)}°{may}"])
    caption = placed(movement, block) + CAPTION.format(count=block.repetition.count)
    key = f"checked-{block.number}" if movement.several else "checked"
    return plain_table(key, caption, heads, rows, style="stacked")


def _change(one: CycleChange, least: float, reported: bool) -> list[str]:
    found = f"{'+' if one.difference >= 0.0 else ''}{sized(one, one.difference)}"
    return [f"<b>{found}</b>" if reported else found, sized(one, least)]
