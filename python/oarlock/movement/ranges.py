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
WELL_SHARE = 0.25
"""A range is measured well enough if half of its 95 % interval is at most this share of it."""


@dataclass(frozen=True)
class MotionRange:
    """Smallest and largest value of an angle, deg, with the standard deviations of both.

    Args:
        name: of the angle.
        lowest_deg: smallest value; over cycles the mean of their smallest values.
        highest_deg: largest value, likewise.
        lowest_std_deg: standard deviation of the track at the smallest value.
        highest_std_deg: the same at the largest value.
        between_deg: standard deviation of the range between cycles; 0 without cycles.
        count: number of cycles; 1 without.
    """

    name: str
    lowest_deg: float
    highest_deg: float
    lowest_std_deg: float
    highest_std_deg: float
    between_deg: float = 0.0
    count: int = 1

    @property
    def range_deg(self) -> float:
        """Distance of both, deg."""
        return self.highest_deg - self.lowest_deg

    @property
    def range_std_deg(self) -> float:
        """Standard deviation of the range, deg.

        An upper limit where both ends share errors, such as a wrong heading: these cancel in a range, but a filter
        does not keep how its errors at two times are correlated, so both ends count as independent. The scatter
        between cycles, divided by the square root of their number, is added in squares.
        """
        scatter = self.between_deg / np.sqrt(self.count)
        return float(np.sqrt(self.lowest_std_deg**2 + self.highest_std_deg**2 + scatter**2))

    @property
    def half_deg(self) -> float:
        """Half of the 95 % interval of the range, deg; NaN if the track has no standard deviations."""
        return BAND_95 * self.range_std_deg

    @property
    def well_measured(self) -> bool:
        """Whether half of the interval is at most a quarter of the range; True without standard deviations."""
        return not self.half_deg > WELL_SHARE * self.range_deg


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
    def limit_deg(self) -> float:
        """Half of the 95 % interval of the difference, deg."""
        return BAND_95 * self.std_deg

    @property
    def certain(self) -> bool:
        """Whether the difference is worth a sentence: above 2 deg and outside its 95 % interval."""
        size = abs(self.difference_deg)
        return size > LEAST_DIFFERENCE_DEG and size > self.limit_deg


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

    The standard deviation of a mean range has two parts, added in squares: that of the track at the extremes, which
    may be the same in all cycles and is not divided by their number, and the scatter of the range between cycles
    divided by the square root of their number. An offset that all samples of a cycle share is in neither.
    Angles with gaps in the cycles are left out.
    """
    found = {}
    for angle in angles:
        courses = cycle_courses(time_s, angle.value_deg, begins_s)
        claimed = cycle_courses(time_s, angle.std_deg, begins_s)
        if not np.isfinite(courses).all():
            continue
        low, high = (_mean_extreme(courses, claimed, pick) for pick in (np.argmin, np.argmax))
        count = len(courses)
        between = float(np.ptp(courses, axis=1).std(ddof=1)) if count > 1 else 0.0
        found[angle.name] = MotionRange(angle.name, low[0], high[0], low[1], high[1], between, count)
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
    return float(courses[rows, places].mean()), float(claimed[rows, places].mean())
