"""Movement of any body: ranges of motion, repeated cycles, left against right, and a report of them.

from oarlock.movement import find_cycles, movement_angles, ranges_of_motion, side_pairs

angles = movement_angles(track)
for stretch in find_cycles(track.time_s, angles):
    print(stretch.count, "cycles of", stretch.period_s, "s")
"""

from oarlock.movement.angles import MovementAngle, movement_angles
from oarlock.movement.cycles import Repetition, cycle_courses, find_cycles
from oarlock.movement.ranges import (
    MotionRange,
    SideDifference,
    cycle_ranges,
    ranges_of_motion,
    side_differences,
    side_pairs,
)

__all__ = [
    "MotionRange",
    "MovementAngle",
    "Repetition",
    "SideDifference",
    "cycle_courses",
    "cycle_ranges",
    "find_cycles",
    "movement_angles",
    "ranges_of_motion",
    "side_differences",
    "side_pairs",
]
