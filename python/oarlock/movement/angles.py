"""The angles of a track's joints in degrees: hinges, and named angles of ball joints. For ranges, cycles and sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from oarlock import Track, joint_angles
from oarlock.model.angle_sequence import angle_labels, angles_from_quat, angles_per_turn
from oarlock.movement.turns import SegmentTurns, Sensitivity
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.joint_angles import JointAngle, NamedRotation, named_rotation
from oarlock.tracking.joint_series import BallSeries
from oarlock.tracking.notes import contradicted_units, undetermined_units

UNDETERMINED, CONTRADICTED, LIMITS, BESIDE = "undetermined", "contradicted", "limits", "beside"
"""What makes an angle unreliable: the mount or the readings of a unit of its joint, its own value, another joint of its
segments."""
UNRELIABLE = (UNDETERMINED, CONTRADICTED)
"""Angles with these doubts lead no block and are no headline."""
OBSERVED_SHARE = 0.5
"""An angle is used if sensors observe it at least in this share of the rows."""
CLEAR_SHARE = 0.8
"""An angle of a ball joint is used if its sequence is away from its poles at least in this share of the rows."""


SHOULDER = "ZXY"
"""Flexion, abduction and rotation: singular only with the arm sideways and level, YXY while it hangs."""
SHOULDER_WORDS = (
    "flexion (forward), abduction (away from the body) and rotation (inward), sequence ZXY; not the plane of "
    "elevation and elevation of the society (YXY), which are singular while the arm hangs"
)
"""What the names of a shoulder's angles mean here."""
_SHOULDERS = ("shoulder_r", "shoulder_l")
"""Shoulders of the shipped bodies."""
_ELBOWS = ("elbow_r", "elbow_l")
"""Elbows that `with_ball_joint` made; only their flexion is known."""
UP = (0.0, 1.0, 0.0)
"""The vertical of bodies whose free segment has names for its angles in the room."""
MIRRORED = (-1.0, -1.0, 1.0)
"""A rotation vector of a left limb in its mirror image."""


@dataclass(frozen=True, eq=False)
class MovementAngle:
    """One angle over time.

    Args:
        name: the hinge's, or that of a ball joint with its sequence and axis: `shoulder YXY y1`.
        label: what the model file says of the joint; empty if it says nothing.
        value_deg: (T,) deg, continuous; NaN where not observed, and near a pole of the sequence.
        std_deg: (T,) standard deviation, deg; NaN if the track has none.
        limits_deg: soft limits of a hinge, deg; None for others.
        sensitivity: what its errors depend on; None if unknown.
        doubt: why it is unreliable whatever its standard deviation, a key of `ranges.CAUSES`; "" if it is not.
    """

    name: str
    label: str
    value_deg: Floats
    std_deg: Floats
    limits_deg: tuple[float, float] | None = None
    sensitivity: Sensitivity | None = None
    doubt: str = ""

    @property
    def passes_limits(self) -> bool:
        """Whether a value is beyond the soft limits by more than half of its 95 % band."""
        if self.limits_deg is None:
            return False
        low, high = self.limits_deg
        beyond_deg = np.maximum(low - self.value_deg, self.value_deg - high)
        return bool((beyond_deg > NORMAL_95 * self.std_deg).any())

    def since(self, first: int) -> MovementAngle:
        """The angle from a sample on."""
        at = self.sensitivity
        late = at and replace(at, turns=at.turns[first:], posture_rad=at.posture_rad[first:])
        return replace(self, value_deg=self.value_deg[first:], std_deg=self.std_deg[first:], sensitivity=late)


def movement_angles(track: Track, turns: SegmentTurns | None = None) -> tuple[MovementAngle, ...]:
    """The observed angles of all joints of a track, in the order of the model.

    The rotation of a free joint is left out: see `room_angles`. So are the angles of a ball joint that is near a pole
    of its sequence for more than a fifth of the time: they say little about its posture.

    `turns`: those of the track, if they are needed several times.

    Raises:
        DataError: the track has no model.
    """
    turns = turns or SegmentTurns(track)
    found: dict[str, list[MovementAngle | None]] = {}
    for joint in turns.joints:
        if joint.kind == "hinge":
            series = track.hinge(joint.name)
            limits = (float(np.degrees(joint.limits[0])), float(np.degrees(joint.limits[1])))
            course = _Course(series.value, series.std, series.observed, turns.of(joint.name))
            found[joint.name] = [_angle(joint.name, joint.label, course, limits)]
        elif joint.kind == "ball":
            found[joint.name] = _ball_angles(track, joint.name, joint.label, turns)
    return _doubted(track, turns, found)


def room_angles(track: Track, turns: SegmentTurns) -> tuple[MovementAngle, ...]:
    """How the free segment of a body stands in the room: its heading, obliquity and tilt; none in other axes."""
    if turns.up != UP:
        return ()
    found = {}
    for joint in turns.joints:
        named = named_rotation(joint.name, is_free=True)
        if joint.kind == "free" and named is not None:
            series = track.ball(joint.name)
            found[joint.name] = _named_angles(joint_angles(track), series, joint.label, named, turns)
    return _doubted(track, turns, found)


def _doubted(
    track: Track, turns: SegmentTurns, found: Mapping[str, Sequence[MovementAngle | None]]
) -> tuple[MovementAngle, ...]:
    """The known angles of each joint, with what makes them unreliable.

    A joint beyond its limits shows that the axes of one of its segments are wrong by more than the bands say. Nothing
    shows which one, so the other joints of both are doubted too, unless the heading of one is not determined.
    """
    known = [(joint, one) for joint, angles in found.items() for one in angles if one is not None]
    segments = {joint: set(turns.segments(joint)) for joint in found}
    undetermined = turns.segments_of_units(undetermined_units(track.notes))
    contradicted = turns.segments_of_units(contradicted_units(track.notes))
    passing = {
        joint
        for joint, one in known
        if one.passes_limits or any(note.startswith(f"{joint}: beyond its ") for note in track.notes)
    }
    twisted = {s for joint in passing if not segments[joint] & undetermined for s in segments[joint]}

    def doubt(joint: str) -> str:
        if segments[joint] & undetermined:
            return UNDETERMINED
        if segments[joint] & contradicted:
            return CONTRADICTED
        return LIMITS if joint in passing else BESIDE if segments[joint] & twisted else ""

    return tuple(replace(one, doubt=doubt(joint)) for joint, one in known)


@dataclass(frozen=True, eq=False)
class _Course:
    """An angle over time, rad, as `MovementAngle` has it in deg."""

    value: Floats
    std: Floats
    observed: Bools
    sensitivity: Sensitivity


def _ball_angles(track: Track, name: str, label: str, turns: SegmentTurns) -> list[MovementAngle | None]:
    series = track.ball(name)
    named = named_rotation(name, is_free=False, shoulder=SHOULDER)
    if named is not None and name in (*_SHOULDERS, *_ELBOWS):
        told = f"{label.partition(':')[0]}: {SHOULDER_WORDS}" if name in _SHOULDERS else label
        return _named_angles(joint_angles(track, shoulder=SHOULDER), series, told, named, turns)
    near = series.near_singular()
    if near.mean() > 1.0 - CLEAR_SHARE:
        return []
    value, std, sequence = series.angles_rad(), series.angles_std_rad(), series.angle_sequence
    changes = angles_per_turn(value, sequence)
    courses = [
        _Course(value[:, k], std[:, k], series.observed & ~near, turns.of(name, changes[:, k]))
        for k in range(3)
    ]
    labels = angle_labels(sequence)
    return [_angle(f"{name} {sequence} {axis}", label, courses[k], None) for k, axis in enumerate(labels)]


def _named_angles(
    angles: Mapping[str, JointAngle],
    series: BallSeries,
    label: str,
    named: NamedRotation,
    turns: SegmentTurns,
) -> list[MovementAngle | None]:
    """Signs and offsets of the names do not matter to the size of an error; the mirror image of a left limb does."""
    rotation = named.rotation(series.quat_wxyz)
    changes = angles_per_turn(angles_from_quat(rotation, named.sequence), named.sequence)
    changes = changes * MIRRORED if named.is_mirrored else changes
    places = range(3) if len(named.names) > 1 else (1,)
    found = []
    for k, name in zip(places, named.names, strict=True):
        one = angles[name]
        clear: Bools = one.observed & ~one.near_singular
        course = _Course(one.angle_rad, one.std_rad, clear, turns.of(series.name, changes[:, k]))
        found.append(_angle(name, label, course, None))
    return found


def _angle(
    name: str, label: str, course: _Course, limits: tuple[float, float] | None
) -> MovementAngle | None:
    known: Bools = course.observed & np.isfinite(course.value)
    if known.mean() < OBSERVED_SHARE:
        return None
    shown, claimed = (np.where(known, np.degrees(array), np.nan) for array in (course.value, course.std))
    return MovementAngle(name, label, shown, claimed, limits, course.sensitivity)
