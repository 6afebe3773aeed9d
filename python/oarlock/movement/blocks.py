"""`MovementAnalysis` and its `MovementBlock`s of repeated movement, with angles and ranges. For the report."""

from __future__ import annotations

from dataclasses import dataclass

from oarlock import Track
from oarlock.movement.angles import MovementAngle
from oarlock.movement.cycles import Repetition
from oarlock.movement.ranges import MotionRange, SideDifference, side_differences


@dataclass(frozen=True, eq=False)
class MovementBlock:
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
class MovementAnalysis:
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
    blocks: tuple[MovementBlock, ...]
    start_s: float

    @property
    def main(self) -> MovementBlock | None:
        """The block with the most cycles."""
        return max(self.blocks, key=lambda one: one.repetition.count, default=None)

    @property
    def several(self) -> bool:
        """Whether there are blocks to tell apart."""
        return len(self.blocks) > 1

    @property
    def block_ranges(self) -> tuple[tuple[MovementBlock | None, MotionRange], ...]:
        """All ranges that the page gives: of each block; with one block or none also those of the whole track."""
        if self.several:
            return tuple((block, one) for block in self.blocks for one in block.ranges.values())
        block = self.main
        return tuple((block, one) for one in {**self.ranges, **(block.ranges if block else {})}.values())

    @property
    def shown(self) -> tuple[MotionRange, ...]:
        """The ranges of `block_ranges`."""
        return tuple(one for _, one in self.block_ranges)

    def ends(self, one: MotionRange) -> MotionRange:
        """The smallest and largest value that the page gives with a range: with one block those of all counted time."""
        return one if self.several else self.ranges.get(one.name, one)

    @property
    def nominal(self) -> bool:
        """Whether the sensors were not calibrated."""
        return bool(self.track.provenance.get("nominal_mounts"))

    @property
    def sides(self) -> tuple[tuple[MovementBlock | None, SideDifference], ...]:
        """Right against left over the cycles of each block, or over the whole track if nothing repeats."""
        if not self.blocks:
            return tuple((None, one) for one in side_differences(self.ranges))
        return tuple((block, one) for block in self.blocks for one in side_differences(block.ranges))
