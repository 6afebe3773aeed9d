"""`Movement`: angles, ranges and cycles of one track, and its table of cycles. For the report."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from oarlock.movement.settled import settled_s


@dataclass(frozen=True, eq=False)
class Movement:
    """What the sections show: the track, its angles, their ranges, and the repetition with the most cycles.

    Ranges and cycles are those from `start_s` on, when the filter has converged; angles are those of the whole track.
    """

    track: Track
    angles: tuple[MovementAngle, ...]
    ranges: dict[str, MotionRange]
    repetitions: tuple[Repetition, ...]
    in_cycles: dict[str, MotionRange]
    start_s: float

    @property
    def main(self) -> Repetition | None:
        """The repetition with the most cycles."""
        return self.repetitions[0] if self.repetitions else None

    @property
    def shown(self) -> dict[str, MotionRange]:
        """The range of each angle: mean over the cycles, or from `start_s` on if nothing repeats."""
        return {**self.ranges, **self.in_cycles}

    @property
    def nominal(self) -> bool:
        """Whether the sensors were not calibrated."""
        return bool(self.track.provenance.get("nominal_mounts"))

    @property
    def sides(self) -> tuple[SideDifference, ...]:
        """Right against left over the cycles, or over the whole track if nothing repeats."""
        return side_differences(self.in_cycles or self.ranges)


def movement_of(track: Track) -> Movement:
    """Angles, ranges and cycles of a track.

    Raises:
        DataError: the track has no model.
    """
    time_s, angles = track.time_s, movement_angles(track)
    start_s = settled_s(time_s, angles)
    first = int(np.searchsorted(time_s, start_s))
    late = [replace(one, value_deg=one.value_deg[first:], std_deg=one.std_deg[first:]) for one in angles]
    late = [one for one in late if np.isfinite(one.value_deg).any()]
    repetitions = find_cycles(time_s[first:], late)
    in_cycles = cycle_ranges(time_s, angles, repetitions[0].begins_s) if repetitions else {}
    ranges = ranges_of_motion(late)
    known = tuple(one for one in angles if one.name in ranges)
    return Movement(track, known, ranges, repetitions, in_cycles, start_s)


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
