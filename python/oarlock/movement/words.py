"""The summary sentences and key figures of a movement's report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite

from oarlock.movement.angles import UNDETERMINED, UNRELIABLE
from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.cycles import Repetition
from oarlock.movement.evenness import CycleChange
from oarlock.movement.ranges import MotionRange
from oarlock.report import KeyFigure, fixed
from oarlock.report.viewer.sides import side_of

MOST_NAMED, MOST_LEADS = 4, 3
PEAKS = (
    "How often the leading angle was largest. From the first to the last peak there is one whole cycle less."
)
CYCLE = "Mean time from one largest value of the leading angle to the next."
RANGE = "Largest minus smallest value of the angle, with half of its 95 % interval."
RANGE_IN_CYCLE = (
    "Largest minus smallest value of the angle within a cycle, mean over the cycles; below it the mean smallest and "
    "largest value, and half of the 95 % interval of the range. An offset that stays the same cancels in a range."
)
MOUNTS = "The interval does not contain errors of the mounts: without calibration a sensor may sit several degrees off."


def counts_from(movement: MovementAnalysis) -> str:
    """From when the numbers count, if the start is left out."""
    skipped = movement.start_s - float(movement.track.time_s[0])
    if skipped <= 0.0:
        return ""
    return f"Numbers count from {fixed(movement.start_s, 1)} s on: before, the estimate still settles."


def repeats(movement: MovementAnalysis) -> list[str]:
    """What repeats, in sentences."""
    if movement.several:
        return [f"{len(movement.blocks)} blocks of repeated movement, each from its first to its last peak."]
    return [
        f"The movement repeats from {span(block)}: {one.peaks} repetitions of {plain(one.lead)}, which are {one.count} "
        f"whole cycles of {fixed(one.period_s, 2)} s from peak to peak, SD "
        f"{fixed(float(one.durations_s.std(ddof=1)), 2)} s ({fixed(60.0 / one.period_s, 0)} per minute)."
        for block in movement.blocks
        for one in [block.repetition]
    ]


def span(block: MovementBlock) -> str:
    """From its first to its last peak: `24 to 30 s`."""
    begins_s = block.repetition.begins_s
    return f"{begins_s[0]:.0f} to {begins_s[-1]:.0f} s"


def titled(block: MovementBlock) -> str:
    """A block for a heading: `Block 2, 24 to 30 s: right shoulder flexion, 4 repetitions (3 whole cycles)`."""
    one = block.repetition
    return f"Block {block.number}, {span(block)}: {plain(one.lead)}, {_counted(one)}"


def _counted(one: Repetition) -> str:
    """`4 repetitions (3 whole cycles)`."""
    return f"{one.peaks} repetitions ({one.count} whole cycles)"


def placed(movement: MovementAnalysis, block: MovementBlock | None) -> str:
    """`Block 2, right elbow flexion: ` before a sentence; "" if there are no blocks to tell apart."""
    if block is None or not movement.several:
        return ""
    return f"Block {block.number}, {plain(block.repetition.lead)}: "


def key_figures(movement: MovementAnalysis) -> list[KeyFigure]:
    """Number and duration of cycles, and the largest ranges that are measured well; of several blocks their leads."""
    if movement.several:
        return [
            _figure(movement, block.lead, block)
            for block in movement.blocks
            if block.lead is not None and block.lead.well_measured
        ]
    found = []
    for block in movement.blocks:
        one = block.repetition
        found += [
            KeyFigure("repetitions", str(one.peaks), f"{span(block)}; {one.count} whole cycles", PEAKS),
            KeyFigure(
                "cycle", f"{fixed(one.period_s, 2)} s", f"{fixed(60.0 / one.period_s, 0)} per minute", CYCLE
            ),
        ]
    return found + [_figure(movement, one) for one in measured(movement.shown)[:MOST_NAMED]]


def measured(ranges: Iterable[MotionRange]) -> list[MotionRange]:
    """The ranges that are measured well enough, the largest first."""
    return sorted((one for one in ranges if one.well_measured), key=lambda one: -one.range_deg)


def quality(movement: MovementAnalysis) -> list[str]:
    """Which angles are measured well, with half of the 95 % interval, and which are not, and why; of each block."""
    if not movement.several:
        return _quality(movement.shown)
    found = []
    for block in movement.blocks:
        told = f"Block {block.number}, {span(block)}: {_counted(block.repetition)} of {plain(block.repetition.lead)}."
        found.append(" ".join([told, *_quality(block.ranges.values())]))
    return found


def _quality(ranges: Iterable[MotionRange]) -> list[str]:
    """The largest of both kinds; angles that hardly moved have their place in the tables only."""
    moved = sorted((one for one in ranges if not one.hardly_moved), key=lambda one: -one.range_deg)
    well = [f"{plain(one.name)} {within(one)}" for one in moved if one.well_measured]
    badly = [
        f"{plain(one.name)}{'' if one.doubt == UNDETERMINED else f' {within(one)}'} ({one.cause})"
        for one in moved
        if not one.well_measured
    ]
    if not any(isfinite(one.half_deg) for one in moved):
        return [f"Ranges: {_first(well)}; the track does not say how certain they are."] if well else []
    found = [f"Range measured well: {_first(well)}." if well else "No angle that moved was measured well."]
    if badly:
        found.append(f"Not measured well: {_first(badly)}.")
    return found


def _first(told: Sequence[str]) -> str:
    """The first ones in a sentence, and how many more there are: a whole body has some thirty angles."""
    more = len(told) - MOST_NAMED
    return ", ".join(told[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def within(one: MotionRange) -> str:
    """`69 ± 5°`; without the interval if the track has none."""
    half = f"\u00a0±\u00a0{fixed(one.half_deg, 0)}" if isfinite(one.half_deg) else ""
    return f"{fixed(one.range_deg, 0)}{half}°"


def _figure(movement: MovementAnalysis, one: MotionRange, led: MovementBlock | None = None) -> KeyFigure:
    """A range with its ends, or with the time of the block that it leads."""
    half = f"± {fixed(one.half_deg, 1)}°" if isfinite(one.half_deg) else ""
    if led is None:
        mounts = ", mounts not calibrated" if half and movement.nominal else ""
        parts = [f"{fixed(one.lowest_deg, 0)} to {fixed(one.highest_deg, 0)}°", half + mounts]
    else:
        parts = [half, span(led)]
    meaning = RANGE_IN_CYCLE if any(one.name in block.ranges for block in movement.blocks) else RANGE
    if movement.nominal:
        meaning += f" {MOUNTS}"
    return KeyFigure(plain(one.name), f"{fixed(one.range_deg, 0)}°", "; ".join(filter(None, parts)), meaning)


def plain(name: str) -> str:
    """The name of an angle for people: `right elbow flexion` of `elbow_flexion_r`."""
    joint, space, axis = name.partition(" ")
    side, stem = side_of(joint)
    return f"{side} {stem}{space}{axis}".strip().replace("_", " ")


def heading(movement: MovementAnalysis) -> str | None:
    """What was done, for the title of a page; None without angles."""
    leads = list(dict.fromkeys(plain(block.repetition.lead) for block in movement.blocks))
    if movement.several and len(leads) <= MOST_LEADS:
        return f"repeated {', '.join(leads[:-1])}{' and ' if leads[1:] else ''}{leads[-1]}"
    if movement.several:
        return f"{len(movement.blocks)} blocks of repeated movement"
    if movement.blocks:
        return f"{movement.blocks[0].repetition.peaks} repetitions of {leads[0]}"
    reliable = [one for one in movement.shown if one.doubt not in UNRELIABLE]
    if not reliable:
        return None
    most = max(measured(reliable) or reliable, key=lambda one: one.range_deg)
    return f"movement, most in {plain(most.name)}"


def named(one: CycleChange) -> str:
    """What a change compares, for people."""
    return f"range of {plain(one.angle)}" if one.angle else "cycle time"


def sized(one: CycleChange, value: float) -> str:
    """A value in the unit of the change: `0.05 s`, `3.1°`."""
    return f"{fixed(value, 1)}°" if one.angle else f"{fixed(value, 2)} s"
