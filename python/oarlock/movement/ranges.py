"""Ranges of motion with their uncertainty, over a track and over cycles, and the right side against the left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from oarlock.movement.angles import BESIDE, CONTRADICTED, LIMITS, UNDETERMINED, MovementAngle
from oarlock.movement.cycles import cycle_courses
from oarlock.movement.turns import Sensitivity
from oarlock.report.viewer.sides import side_of
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.statistics import NORMAL_95

LEAST_DIFFERENCE_DEG = 2.0
"""Differences of the sides below this are not reported, even if they are certain."""
DRIFTS, WIDE = "drifts", "wide"
WITHIN_DEG = 5.0
"""An angle is measured well only if half of its 95 % band is at most this."""
CAUSES = {
    UNDETERMINED: "the heading of a unit beside it is not determined",
    CONTRADICTED: "joints contradict its unit",
    LIMITS: "it passes the limits of its joint",
    BESIDE: "a joint beside it passes its limits",
    DRIFTS: "it drifts",
    WIDE: f"its single values are less certain than ± {WITHIN_DEG:.0f}°",
    "axes": "other angles change with it",
    "skin": "units move with the skin",
    "ends": "the estimate drifts",
    "scatter": "cycles differ",
}
"""What makes an angle, or its range, uncertain."""
LEAST_MOVEMENT_DEG = 5.0
"""Angles that move less hardly moved: they are grey, and not drawn over cycles. Middles that wander by less are not
reported."""
LEAST_STEEP = 0.1
"""Change of an angle by a rotation of the segments, deg/deg, below which its errors have another cause."""
WELL_SHARE = 0.25
"""A range is measured well enough if half of its 95 % interval is at most this share of it."""
SKIN_SHARE = 2.0 / 90.0
"""Standard deviation of the rotation of a unit on its segment about each axis, for each deg of posture: the field
simulator's 2 deg at 90 deg (Hamming et al. 2012 found up to 4 deg)."""
WANDER_IN_CYCLES, WANDER_IN_TRACK = 0.2, 0.5
"""Share of the standard deviations of both ends that is independent, half a cycle apart and anywhere in a track:
measured, see docs/report.md."""


@dataclass(frozen=True)
class RangeErrors:
    """Standard deviations of a range, deg, by errors that depend on the postures of both ends.

    Args:
        axes_deg: by errors of the axes of both segments, such as mounts and headings, which are the same at both ends:
            (turns at the largest value - turns at the smallest) times the error. It cancels between like postures.
        skin_deg: by units that turn on their segments as joints move; those on rigid mounts do not.
        ends_deg: by errors that wander, a share of the standard deviations of the track at both ends.
    """

    axes_deg: float
    skin_deg: float
    ends_deg: float


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
        parts: standard deviations of the range by what both ends share; None if the ends count as independent.
        doubt: why the angle itself is not measured well, a key of `CAUSES`; "" if nothing says so.
    """

    name: str
    lowest_deg: float
    highest_deg: float
    lowest_std_deg: float
    highest_std_deg: float
    between_deg: float = 0.0
    count: int = 1
    parts: RangeErrors | None = None
    doubt: str = ""

    @property
    def range_deg(self) -> float:
        """Distance of both, deg."""
        return self.highest_deg - self.lowest_deg

    @property
    def range_std_deg(self) -> float:
        """Standard deviation of the range, deg: see `RangeErrors`; without parts both ends count as independent.

        The scatter between cycles, divided by the square root of their number, is added in squares.
        """
        scatter = self.between_deg / np.sqrt(self.count)
        return float(np.linalg.norm([scatter, *self._shares.values()]))

    @property
    def half_deg(self) -> float:
        """Half of the 95 % interval of the range, deg; NaN if the track has no standard deviations."""
        return NORMAL_95 * self.range_std_deg

    @property
    def is_narrow(self) -> bool:
        """Whether half of the interval is at most a quarter of the range; True without standard deviations."""
        return not self.half_deg > WELL_SHARE * self.range_deg

    @property
    def well_measured(self) -> bool:
        """Whether the interval of the range is narrow and nothing speaks against the angle itself."""
        return self.is_narrow and not self.doubt

    @property
    def hardly_moved(self) -> bool:
        """Whether the angle moved by less than 5 deg."""
        return self.range_deg < LEAST_MOVEMENT_DEG

    @property
    def cause(self) -> str:
        """What speaks against the angle, else the largest part of the range's standard deviation, for people."""
        if self.doubt:
            return CAUSES[self.doubt]
        scatter = self.between_deg / np.sqrt(self.count)
        sizes = {**self._shares, "scatter": scatter}
        return CAUSES[max(sizes, key=lambda name: sizes[name])]

    @property
    def _shares(self) -> dict[str, float]:
        """Standard deviations by what the ends have in common and what not, deg."""
        if self.parts is None:
            return {"ends": float(np.hypot(self.lowest_std_deg, self.highest_std_deg))}
        return {"axes": self.parts.axes_deg, "skin": self.parts.skin_deg, "ends": self.parts.ends_deg}


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
        return NORMAL_95 * self.std_deg

    @property
    def well_measured(self) -> bool:
        """Whether both ranges are."""
        return self.right.well_measured and self.left.well_measured

    @property
    def certain(self) -> bool:
        """Whether it is worth a sentence: both ranges measured well, above 2 deg and outside its 95 % interval."""
        size = abs(self.difference_deg)
        return self.well_measured and size > LEAST_DIFFERENCE_DEG and size > self.limit_deg


def ranges_of_motion(angles: Sequence[MovementAngle]) -> dict[str, MotionRange]:
    """The range of each angle over the whole track, by its name."""
    found = {}
    for angle in angles:
        ends = np.array([[np.nanargmin(angle.value_deg), np.nanargmax(angle.value_deg)]])
        told = angle.sensitivity
        at = told and replace(told, turns=told.turns[ends], posture_rad=told.posture_rad[ends])
        one = _range(angle.name, angle.value_deg[ends], angle.std_deg[ends], at, WANDER_IN_TRACK)
        found[angle.name] = replace(one, doubt=angle.doubt or _band_doubt(angle.std_deg))
    return found


def cycle_ranges(time_s: Floats, angles: Sequence[MovementAngle], begins_s: Floats) -> dict[str, MotionRange]:
    """The mean range over cycles of each angle, by its name.

    The standard deviation of a mean range has the parts of `RangeErrors`, which may be the same in all cycles and are
    not divided by their number, and the scatter of the range between cycles divided by the square root of their
    number. An offset that all samples of a cycle share is in neither. Angles with gaps in the cycles are left out.
    """
    found = {}
    for angle in angles:
        courses = cycle_courses(time_s, angle.value_deg, begins_s)
        if not np.isfinite(courses).all():
            continue
        ends = np.stack([courses.argmin(axis=1), courses.argmax(axis=1)], axis=1)
        cycles = np.arange(len(courses))[:, None]

        def chosen(columns: Floats, ends: Ints = ends, cycles: Ints = cycles) -> Floats:
            return np.stack([cycle_courses(time_s, one, begins_s)[cycles, ends] for one in columns.T], axis=2)

        stds = cycle_courses(time_s, angle.std_deg, begins_s)
        claimed = stds[cycles, ends]
        told = angle.sensitivity
        at = told and replace(told, turns=chosen(told.turns), posture_rad=chosen(told.posture_rad))
        one = _range(angle.name, courses[cycles, ends], claimed, at, WANDER_IN_CYCLES)
        found[angle.name] = replace(one, doubt=angle.doubt or _band_doubt(stds.ravel()))
    return found


def _band_doubt(std_deg: Floats) -> str:
    """Whether half of the 95 % band exceeds 5 deg: its root mean square in any third of the time.

    The angle drifts if it does so in the last third and not in the first.
    """
    known = std_deg[np.isfinite(std_deg)]
    thirds = np.array_split(known, 3) if known.size >= 3 else [known] if known.size else []
    halves_deg = [NORMAL_95 * float(np.sqrt(np.mean(third**2))) for third in thirds]
    if max(halves_deg, default=0.0) <= WITHIN_DEG:
        return ""
    return DRIFTS if halves_deg[0] <= WITHIN_DEG < halves_deg[-1] else WIDE


def _range(name: str, values: Floats, claimed: Floats, at: Sensitivity | None, wander: float) -> MotionRange:
    """From smallest and largest values (n, 2) of n cycles, standard deviations, and what errors depend on there."""
    low, high = (float(value) for value in values.mean(axis=0))
    low_std, high_std = (float(value) for value in claimed.mean(axis=0))
    between = float(np.diff(values)[:, 0].std(ddof=1)) if len(values) > 1 else 0.0
    parts = None if at is None else range_errors(claimed, at, wander)
    return MotionRange(name, low, high, low_std, high_std, between, len(values), parts)


def range_errors(claimed_deg: Floats, at: Sensitivity, wander: float) -> RangeErrors | None:
    """The parts of the standard deviation of a mean range that depend on the postures of both ends.

    The errors of the axes of both segments are isotropic, of one size, and as large as the standard deviation of the
    track at each end requires.

    Args:
        claimed_deg: (n, 2) standard deviation of the track at the smallest and the largest value of n cycles, deg.
        at: turns (n, 2, 6) and postures (n, 2, m) there.
        wander: share of the standard deviations that is independent.

    Returns:
        None where an angle hardly follows a rotation of the segments, or nothing is known.
    """
    steep = np.linalg.norm(at.turns, axis=2)
    if not (steep > LEAST_STEEP).all() or not np.isfinite(claimed_deg).all():
        return None
    errors = np.diff(claimed_deg[..., None] / steep[..., None] * at.turns, axis=1).mean(axis=(0, 1))
    moved_deg = np.degrees(np.linalg.norm(np.diff(at.posture_rad, axis=1).mean(axis=(0, 1))))
    soft = np.linalg.norm(at.turns * np.repeat(at.soft, 3), axis=2)
    skin = SKIN_SHARE * moved_deg * float(soft.mean())
    ends = wander * float(np.linalg.norm(claimed_deg.mean(axis=0)))
    return RangeErrors(float(np.linalg.norm(errors)), float(skin), ends)


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
