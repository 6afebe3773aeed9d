"""Ranges of motion with their uncertainty, over a track and over cycles, and the right side against the left."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.movement.angles import Floats, MovementAngle
from oarlock.movement.cycles import cycle_courses
from oarlock.report.viewer.sides import side_of

BAND_95 = 1.959964
"""Half width of the 95 % band of a normal distribution in standard deviations."""
LEAST_DIFFERENCE_DEG = 2.0
"""Differences of the sides below this are not reported, even if they are certain."""


@dataclass(frozen=True)
class MotionRange:
    """Smallest and largest value of an angle, deg, with the standard deviations of both."""

    name: str
    lowest_deg: float
    highest_deg: float
    lowest_std_deg: float
    highest_std_deg: float

    @property
    def range_deg(self) -> float:
        """Distance of both, deg."""
        return self.highest_deg - self.lowest_deg

    @property
    def range_std_deg(self) -> float:
        """Standard deviation of the range, deg: of both ends as if independent, too large where their errors agree."""
        return float(np.hypot(self.lowest_std_deg, self.highest_std_deg))


@dataclass(frozen=True)
class SideDifference:
    """The right range against the left, means over cycles or of the whole track, deg.

    Args:
        name: of the angle without its side.
        right: range of the right side.
        left: range of the left side.
    """

    name: str
    right: MotionRange
    left: MotionRange

    @property
    def difference_deg(self) -> float:
        """Right minus left range, deg."""
        return self.right.range_deg - self.left.range_deg

    @property
    def std_deg(self) -> float:
        """Standard deviation of the difference, deg."""
        return float(np.hypot(self.right.range_std_deg, self.left.range_std_deg))

    @property
    def certain(self) -> bool:
        """Whether the difference is worth a sentence: above 2 deg and outside its 95 % interval."""
        size = abs(self.difference_deg)
        return size > LEAST_DIFFERENCE_DEG and size > BAND_95 * self.std_deg


def ranges_of_motion(angles: Sequence[MovementAngle]) -> dict[str, MotionRange]:
    """The range of each angle over the whole track, by its name."""
    found = {}
    for angle in angles:
        low, high = int(np.nanargmin(angle.value_deg)), int(np.nanargmax(angle.value_deg))
        value, std = angle.value_deg, angle.std_deg
        found[angle.name] = MotionRange(
            angle.name, float(value[low]), float(value[high]), float(std[low]), float(std[high])
        )
    return found


def cycle_ranges(time_s: Floats, angles: Sequence[MovementAngle], begins_s: Floats) -> dict[str, MotionRange]:
    """The mean range over cycles of each angle, by its name.

    The standard deviation of a mean has two parts, added in squares: that of the track at the extremes, which may be
    the same in all cycles and is not divided by their number, and the scatter between cycles divided by its square
    root.
    Angles with gaps in the cycles are left out.
    """
    found = {}
    for angle in angles:
        courses = cycle_courses(time_s, angle.value_deg, begins_s)
        claimed = cycle_courses(time_s, angle.std_deg, begins_s)
        if not np.isfinite(courses).all():
            continue
        low, high = (_mean_extreme(courses, claimed, pick) for pick in (np.argmin, np.argmax))
        found[angle.name] = MotionRange(angle.name, low[0], high[0], low[1], high[1])
    return found


def side_pairs(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Name without its side -> the names of the right and the left one: `knee_flexion` of `knee_flexion_r`."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        joint, space, angle = name.partition(" ")
        side, stem = side_of(joint)
        found.setdefault(stem + space + angle, {})[side] = name
    return {
        stem: (both["right"], both["left"])
        for stem, both in found.items()
        if {"right", "left"} <= both.keys()
    }


def side_differences(ranges: Mapping[str, MotionRange]) -> tuple[SideDifference, ...]:
    """Right against left for all angles that exist on both sides."""
    pairs = side_pairs(list(ranges))
    return tuple(SideDifference(name, ranges[r], ranges[left]) for name, (r, left) in pairs.items())


def _mean_extreme(
    courses: Floats, claimed: Floats, pick: Callable[..., NDArray[np.int64]]
) -> tuple[float, float]:
    rows, places = np.arange(len(courses)), pick(courses, axis=1)
    values, stds = courses[rows, places], claimed[rows, places]
    scatter = float(values.std(ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else 0.0
    return float(values.mean()), float(np.hypot(np.mean(stds), scatter))
