"""Differences between the cycles of a movement: first against last third, and angles whose middle wanders.

For the findings, and for what they could have shown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.cycles import RATE_HZ, cycle_courses
from oarlock.movement.ranges import LEAST_MOVEMENT_DEG
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import range_quantile, student_quantile

CHANCE = 0.05 / 3.0
"""Of a false finding among changes of numbers, among changes of middles, and among spans of middles."""
LEAST_CYCLES = 6
"""Cycles that a comparison of thirds needs: two in each."""
LEAST_CHANGE_DEG = 2.0
"""Smaller changes of a range are not reported, even if they are certain."""
LEAST_CHANGE_S = 0.5 / RATE_HZ
"""The same for the duration of a cycle: half of a step of the search for cycles."""


@dataclass(frozen=True)
class CycleChange:
    """A number of the cycles, its means over the first and the last third, in its unit.

    Args:
        angle: name of the angle whose range it is; "" for the duration of a cycle.
        first: mean of the first third, deg or s.
        last: mean of the last third.
        limit: half of the interval of last minus first; chance is controlled over all numbers that are compared.
    """

    angle: str
    first: float
    last: float
    limit: float

    @property
    def difference(self) -> float:
        """Last minus first."""
        return self.last - self.first

    @property
    def least(self) -> float:
        """The smallest change that is reported: outside the interval, and above 2 deg or 0.02 s."""
        return max(self.limit, LEAST_CHANGE_DEG if self.angle else LEAST_CHANGE_S)

    @property
    def certain(self) -> bool:
        """Whether it is reported."""
        return abs(self.difference) > self.least


@dataclass(frozen=True)
class Wander:
    """How the middle of an angle (its mean over a cycle) wanders over the cycles.

    Args:
        change: of the middle from the first to the last third, deg, against the scatter between cycles.
        span_deg: largest minus smallest middle.
        limit_deg: what this span can reach by the uncertainty that the track claims; NaN if it claims none.
        moves_deg: mean range of the angle in a cycle.
    """

    change: CycleChange
    span_deg: float
    limit_deg: float
    moves_deg: float

    @property
    def angle(self) -> str:
        """Name of the angle."""
        return self.change.angle

    @property
    def beyond(self) -> bool:
        """Whether the span is more than the claimed uncertainty explains."""
        return self.span_deg > self.limit_deg

    @property
    def certain(self) -> bool:
        """Whether the span is above 5 deg, and beyond its limit or a change from the first to the last third."""
        return self.span_deg > LEAST_MOVEMENT_DEG and (self.beyond or self.change.certain)


def changes(movement: MovementAnalysis, block: MovementBlock) -> tuple[CycleChange, ...]:
    """Duration of the cycles of a block, and the range of each angle that is measured well: first against last third.

    Student's t on the scatter within both thirds, with Bonferroni's correction; empty below six cycles.
    """
    if block.repetition.count < LEAST_CYCLES:
        return ()
    numbers = {"": block.repetition.durations_s}
    for angle in block.angles:
        one = block.ranges.get(angle.name)
        if one is not None and one.well_measured and not one.hardly_moved:
            numbers[angle.name] = np.ptp(_courses(movement, block, angle.value_deg), axis=1)
    compared = len(numbers) * _compared(movement)
    return tuple(_change(name, values, compared) for name, values in numbers.items())


def wanderings(movement: MovementAnalysis, block: MovementBlock) -> tuple[Wander, ...]:
    """The middles over the cycles of a block, the one that wanders most first; empty below six cycles.

    Angles that are unreliable are left out. The limit takes errors of one cycle as shared and those of different cycles
    as independent: then the span follows Tukey's studentized range, here with Bonferroni's correction.
    """
    count = block.repetition.count
    angles = [one for one in block.angles if one.name in block.ranges and not one.doubt]
    if count < LEAST_CYCLES or not angles:
        return ()
    compared = len(angles) * _compared(movement)
    factor = range_quantile(1.0 - CHANCE / compared, count)
    found = []
    for angle in angles:
        middles = _courses(movement, block, angle.value_deg).mean(axis=1)
        std = float(np.mean(_courses(movement, block, angle.std_deg)))
        moves = block.ranges[angle.name].range_deg
        change = _change(angle.name, middles, compared)
        found.append(Wander(change, float(np.ptp(middles)), factor * std, moves))
    return tuple(sorted(found, key=lambda one: -one.span_deg))


def drifting(movement: MovementAnalysis, block: MovementBlock) -> frozenset[str]:
    """Names of the angles of a block whose middle wanders as drift of the estimate would.

    A middle may wander as far as the uncertainty allows; where no magnetometer measured a heading, any wandering may be
    drift.
    """
    info = movement.track.info
    heading_known = info is not None and bool((info.field > 0).any())
    return frozenset(
        one.angle for one in wanderings(movement, block) if one.certain and not (one.beyond and heading_known)
    )


def _compared(movement: MovementAnalysis) -> int:
    """Blocks that are compared: chance is controlled over all of them."""
    return sum(one.repetition.count >= LEAST_CYCLES for one in movement.blocks)


def _change(name: str, values: Floats, compared: int) -> CycleChange:
    """Bonferroni's correction for so many comparisons; the scatter is that within the three thirds."""
    part = len(values) // 3
    thirds = (values[:part], values[part:-part], values[-part:])
    freedom = len(values) - len(thirds)
    pooled = sum(float(((one - one.mean()) ** 2).sum()) for one in thirds) / freedom
    quantile = student_quantile(1.0 - 0.5 * CHANCE / compared, freedom)
    limit = quantile * float(np.sqrt(2.0 * pooled / part))
    return CycleChange(name, float(thirds[0].mean()), float(thirds[2].mean()), limit)


def _courses(movement: MovementAnalysis, block: MovementBlock, values: Floats) -> Floats:
    return cycle_courses(movement.track.time_s, values, block.repetition.begins_s)
