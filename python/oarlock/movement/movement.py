"""`Movement`: angles, ranges and blocks of repeated movement of one track, and its table of cycles. For the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from oarlock import Track
from oarlock.movement.angles import Floats, MovementAngle, movement_angles, room_angles
from oarlock.movement.cycles import Repetition, cycle_courses, find_cycles
from oarlock.movement.ranges import (
    MotionRange,
    SideDifference,
    cycle_ranges,
    ranges_of_motion,
    side_differences,
)
from oarlock.movement.settled import settled_s
from oarlock.movement.turns import SegmentTurns


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of repeated movement: a warm-up, bends of one elbow, a walk.

    Args:
        number: 1 for the first in time.
        repetition: its cycles and its leading angle.
        ranges: mean range over its cycles of each angle, by name.
        angles: the angles of the joints; also those of the free segment in the room if one of them leads.
    """

    number: int
    repetition: Repetition
    ranges: dict[str, MotionRange]
    angles: tuple[MovementAngle, ...]

    @property
    def lead(self) -> MotionRange | None:
        """The range of the leading angle; None if it has gaps."""
        return self.ranges.get(self.repetition.lead)


@dataclass(frozen=True, eq=False)
class Movement:
    """What the sections show: the track, its angles, their ranges, and its blocks of repeated movement.

    Ranges and cycles are those from `start_s` on, when the filter has converged; angles are those of the whole track.

    Args:
        track: the track.
        angles: of the joints; also those of the free segment in the room if one of them leads a block.
        ranges: over the whole track, by name; those in the room are not among them.
        blocks: in the order of time.
        start_s: from when numbers count.
    """

    track: Track
    angles: tuple[MovementAngle, ...]
    ranges: dict[str, MotionRange]
    blocks: tuple[Block, ...]
    start_s: float

    @property
    def main(self) -> Block | None:
        """The block with the most cycles."""
        return max(self.blocks, key=lambda one: one.repetition.count, default=None)

    @property
    def several(self) -> bool:
        """Whether there are blocks to tell apart."""
        return len(self.blocks) > 1

    @property
    def shown(self) -> tuple[MotionRange, ...]:
        """All ranges that the page gives: of each block; with one block or none also those of the whole track."""
        if self.several:
            return tuple(one for block in self.blocks for one in block.ranges.values())
        return tuple({**self.ranges, **(self.blocks[0].ranges if self.blocks else {})}.values())

    @property
    def nominal(self) -> bool:
        """Whether the sensors were not calibrated."""
        return bool(self.track.provenance.get("nominal_mounts"))

    @property
    def sides(self) -> tuple[tuple[Block | None, SideDifference], ...]:
        """Right against left over the cycles of each block, or over the whole track if nothing repeats."""
        if not self.blocks:
            return tuple((None, one) for one in side_differences(self.ranges))
        return tuple((block, one) for block in self.blocks for one in side_differences(block.ranges))


def movement_of(track: Track) -> Movement:
    """Angles, ranges and blocks of a track.

    Where the joints do not repeat, the free segment may: a person who bows. Its angles in the room count only in blocks
    that they lead.

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
        if not any(_meet(one, block.repetition) for block in found)
    ]
    blocks = sorted((*found, *turned), key=lambda one: float(one.repetition.begins_s[0]))
    numbered = tuple(replace(one, number=k) for k, one in enumerate(blocks, 1))
    return Movement(track, (*known, *room) if turned else known, ranges, numbered, start_s)


def cycles_table(movement: Movement) -> pa.Table:
    """One row per cycle: block, start, duration, and smallest, largest value and range of each angle, deg."""
    return pa.concat_tables([_cycles(movement, block) for block in movement.blocks])


def _cycles(movement: Movement, block: Block) -> pa.Table:
    begins_s, count = block.repetition.begins_s, block.repetition.count
    columns: dict[str, object] = {
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
    return pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})


def _late(time_s: Floats, angles: Sequence[MovementAngle], start_s: float) -> list[MovementAngle]:
    """The angles from a time on, without those that are unknown there."""
    late = [one.since(int(np.searchsorted(time_s, start_s))) for one in angles]
    return [one for one in late if np.isfinite(one.value_deg).any()]


def _repetitions(
    time_s: Floats, angles: Sequence[MovementAngle], start_s: float, taken: Sequence[Repetition] = ()
) -> tuple[Repetition, ...]:
    first = int(np.searchsorted(time_s, start_s))
    return find_cycles(time_s[first:], _late(time_s, angles, start_s), taken)


def _block(time_s: Floats, repetition: Repetition, angles: tuple[MovementAngle, ...]) -> Block:
    ranges = cycle_ranges(time_s, angles, repetition.begins_s)
    return Block(0, repetition, ranges, angles)


def _meet(one: Repetition, other: Repetition) -> bool:
    return bool(one.begins_s[0] < other.begins_s[-1] and other.begins_s[0] < one.begins_s[-1])
