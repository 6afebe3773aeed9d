"""`movement_of`: angles, ranges and blocks of a track; and its table of cycles. For the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock import Track
from oarlock.movement.angles import UNRELIABLE, MovementAngle, movement_angles, room_angles
from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.cycles import Repetition, cycle_courses, find_cycles
from oarlock.movement.evenness import drifting
from oarlock.movement.ranges import DRIFTS, MotionRange, cycle_ranges, ranges_of_motion
from oarlock.movement.turns import SegmentTurns
from oarlock.storage.arrays import Floats


@lru_cache(maxsize=1)  # the report and the terminal give the same analysis
def movement_of(track: Track) -> MovementAnalysis:
    """Angles, ranges and blocks of a track.

    Where the joints do not repeat, the free segment may: a person who bows. Its angles in the room count only in blocks
    that they lead. Angles at a unit that its joints contradict, or without a heading, lead none.

    Raises:
        DataError: the track has no model.
    """
    turns = SegmentTurns(track)
    time_s, angles = track.time_s, movement_angles(track, turns)
    start_s = settled_s(time_s, angles)
    ranges = ranges_of_motion(_late(time_s, angles, start_s))
    known = tuple(one for one in angles if one.name in ranges)
    found = [_block(time_s, one, known) for one in _repetitions(time_s, known, start_s)]
    room = room_angles(track, turns) if known else ()
    turned = [
        _block(time_s, one, (*known, *room))
        for one in _repetitions(time_s, room, start_s, [block.repetition for block in found])
        if not any(
            one.begins_s[0] < block.repetition.begins_s[-1]
            and block.repetition.begins_s[0] < one.begins_s[-1]
            for block in found
        )
    ]
    blocks = sorted((*found, *turned), key=lambda one: float(one.repetition.begins_s[0]))
    numbered = tuple(replace(one, number=k) for k, one in enumerate(blocks, 1))
    whole = MovementAnalysis(track, (*known, *room) if turned else known, ranges, numbered, start_s)
    return replace(whole, blocks=tuple(replace(block, ranges=_doubted(whole, block)) for block in numbered))


def _doubted(movement: MovementAnalysis, block: MovementBlock) -> dict[str, MotionRange]:
    """The ranges of a block, with those of angles that drift marked."""
    drifts = drifting(movement, block)
    return {
        name: replace(one, doubt=one.doubt or DRIFTS) if name in drifts else one
        for name, one in block.ranges.items()
    }


def cycles_table(movement: MovementAnalysis) -> dict[str, NDArray[Any]]:
    """One row per cycle: block, start, duration, and smallest, largest value and range of each angle, deg."""
    tables = [_cycles(movement, block) for block in movement.blocks]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _cycles(movement: MovementAnalysis, block: MovementBlock) -> dict[str, NDArray[Any]]:
    begins_s, count = block.repetition.begins_s, block.repetition.count
    columns: dict[str, NDArray[Any]] = {
        "block": np.full(count, block.number),
        "cycle": np.arange(1, count + 1),
        "start_s": begins_s[:-1],
        "duration_s": block.repetition.durations_s,
    }
    for angle in movement.angles:
        courses = cycle_courses(movement.track.time_s, angle.value_deg, begins_s)
        low, high = courses.min(axis=1), courses.max(axis=1)
        name = angle.name.replace(" ", "_")
        columns |= {f"{name}_min_deg": low, f"{name}_max_deg": high, f"{name}_range_deg": high - low}
    return columns


def _late(time_s: Floats, angles: Sequence[MovementAngle], start_s: float) -> list[MovementAngle]:
    """The angles from a time on, without those that are unknown there."""
    late = [one.since(int(np.searchsorted(time_s, start_s))) for one in angles]
    return [one for one in late if np.isfinite(one.value_deg).any()]


def _repetitions(
    time_s: Floats, angles: Sequence[MovementAngle], start_s: float, taken: Sequence[Repetition] = ()
) -> tuple[Repetition, ...]:
    first = int(np.searchsorted(time_s, start_s))
    reliable = [one for one in angles if one.doubt not in UNRELIABLE]
    return find_cycles(time_s[first:], _late(time_s, reliable, start_s), taken)


def _block(time_s: Floats, repetition: Repetition, angles: tuple[MovementAngle, ...]) -> MovementBlock:
    ranges = cycle_ranges(time_s, angles, repetition.begins_s)
    return MovementBlock(0, repetition, ranges, angles)


USUAL = 0.95
"""Quantile of the standard deviations of the second half that counts as their usual largest value."""
NEAR = 1.25
"""A standard deviation has settled within a quarter of this value."""


def settled_s(time_s: Floats, angles: Sequence[MovementAngle]) -> float:
    """The time by which the standard deviations of all angles have fallen to what is usual in the second half, s.

    The angle that settles last decides. Angles without standard deviations, and those that begin later than the
    track, do not count. At the latest it is the middle of the track.
    """
    found = [_settles_s(time_s, angle) for angle in angles if np.isfinite(angle.std_deg[:1]).all()]
    return max(found, default=float(time_s[0]))


def _settles_s(time_s: Floats, angle: MovementAngle) -> float:
    middle_s = 0.5 * float(time_s[0] + time_s[-1])
    later = angle.std_deg[time_s >= middle_s]
    later = later[np.isfinite(later)]
    if not later.size:
        return float(time_s[0])
    reached = time_s[angle.std_deg <= NEAR * float(np.quantile(later, USUAL))]
    return min(float(reached[0]), middle_s) if reached.size else middle_s
