"""`Movement`: angles, ranges and cycles of one track, and its table of cycles. For the report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from oarlock import Track
from oarlock.movement.angles import MovementAngle, movement_angles
from oarlock.movement.cycles import Repetition, cycle_courses, find_cycles
from oarlock.movement.ranges import (
    MotionRange,
    SideDifference,
    cycle_ranges,
    ranges_of_motion,
    side_differences,
)


@dataclass(frozen=True, eq=False)
class Movement:
    """What the sections show: the track, its angles, their ranges, and the repetition with the most cycles."""

    track: Track
    angles: tuple[MovementAngle, ...]
    ranges: dict[str, MotionRange]
    repetitions: tuple[Repetition, ...]
    in_cycles: dict[str, MotionRange]

    @property
    def main(self) -> Repetition | None:
        """The repetition with the most cycles."""
        return self.repetitions[0] if self.repetitions else None

    @property
    def sides(self) -> tuple[SideDifference, ...]:
        """Right against left over the cycles, or over the whole track if nothing repeats."""
        return side_differences(self.in_cycles or self.ranges)


def movement_of(track: Track) -> Movement:
    """Angles, ranges and cycles of a track.

    Raises:
        DataError: the track has no model.
    """
    angles = movement_angles(track)
    repetitions = find_cycles(track.time_s, angles)
    in_cycles = cycle_ranges(track.time_s, angles, repetitions[0].begins_s) if repetitions else {}
    return Movement(track, angles, ranges_of_motion(angles), repetitions, in_cycles)


def cycles_table(movement: Movement, repetition: Repetition) -> pa.Table:
    """One row per cycle: start, duration, and smallest, largest value and range of each angle, deg."""
    columns: dict[str, object] = {
        "cycle": np.arange(1, repetition.count + 1),
        "start_s": repetition.begins_s[:-1],
        "duration_s": repetition.durations_s,
    }
    for angle in movement.angles:
        courses = cycle_courses(movement.track.time_s, angle.value_deg, repetition.begins_s)
        low, high = courses.min(axis=1), courses.max(axis=1)
        name = angle.name.replace(" ", "_")
        columns |= {f"{name}_min_deg": low, f"{name}_max_deg": high, f"{name}_range_deg": high - low}
    return pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
