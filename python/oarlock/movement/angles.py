"""The angles of a track's joints in degrees: hinges, and named angles of ball joints. For ranges, cycles and sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock import DataError, JointAngle, Track, joint_angles
from oarlock.model.angle_sequence import angle_labels

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

OBSERVED_SHARE = 0.5
"""An angle is used if sensors observe it at least in this share of the rows."""
CLEAR_SHARE = 0.8
"""An angle of a ball joint is used if its sequence is away from its poles at least in this share of the rows."""


_SHOULDERS = dict.fromkeys(("shoulder_r", "shoulder_l"), ("flexion", "abduction", "rotation"))
"""Shoulders of the shipped bodies: ZXY is singular only with the arm sideways and level, YXY while it hangs."""
_ELBOWS = {"elbow_r": "elbow_flexion_r", "elbow_l": "elbow_flexion_l"}
"""Elbows that `with_ball_joint` made, and the one angle of each that is known."""


@dataclass(frozen=True, eq=False)
class MovementAngle:
    """One angle over time.

    Args:
        name: the hinge's, or that of a ball joint with its sequence and axis: `shoulder YXY y1`.
        label: what the model file says of the joint; empty if it says nothing.
        value_deg: (T,) deg, continuous; NaN where not observed, and near a pole of the sequence.
        std_deg: (T,) standard deviation, deg; NaN if the track has none.
        limits_deg: soft limits of a hinge, deg; None for others.
    """

    name: str
    label: str
    value_deg: Floats
    std_deg: Floats
    limits_deg: tuple[float, float] | None = None


def movement_angles(track: Track) -> tuple[MovementAngle, ...]:
    """The observed angles of all joints of a track, in the order of the model.

    The rotation of a free joint is left out: it says how the whole body is turned. So are the angles of a ball joint
    that is near a pole of its sequence for more than a fifth of the time: they say little about its posture.

    Raises:
        DataError: the track has no model.
    """
    if track.model is None:
        raise DataError("movement_angles: this track was loaded without its model; load the model file again")
    found = []
    for joint in track.model.describe().joints:
        if joint.kind == "hinge":
            series = track.hinge(joint.name)
            limits = (float(np.degrees(joint.limits[0])), float(np.degrees(joint.limits[1])))
            found.append(_angle(joint.name, joint.label, series.value, series.std, series.observed, limits))
        elif joint.kind == "ball":
            found += _ball_angles(track, joint.name, joint.label)
    return tuple(angle for angle in found if angle is not None)


def _ball_angles(track: Track, name: str, label: str) -> list[MovementAngle | None]:
    if name in _SHOULDERS:
        side = name.rpartition("_")[2]
        named = joint_angles(track, shoulder="ZXY")
        return [_named_angle(named[f"shoulder_{what}_{side}"], label) for what in _SHOULDERS[name]]
    if name in _ELBOWS:
        return [_named_angle(joint_angles(track)[_ELBOWS[name]], label)]
    series = track.ball(name)
    near = series.near_singular()
    if near.mean() > 1.0 - CLEAR_SHARE:
        return []
    clear: Bools = series.observed & ~near
    value, std, sequence = series.angles_rad(), series.angles_std_rad(), series.angle_sequence
    return [
        _angle(f"{name} {sequence} {axis}", label, value[:, k], std[:, k], clear, None)
        for k, axis in enumerate(angle_labels(sequence))
    ]


def _named_angle(named: JointAngle, label: str) -> MovementAngle | None:
    clear: Bools = named.observed & ~named.near_singular
    return _angle(named.name, label, named.angle_rad, named.std_rad, clear, None)


def _angle(
    name: str, label: str, value: Floats, std: Floats, observed: Bools, limits: tuple[float, float] | None
) -> MovementAngle | None:
    known: Bools = observed & np.isfinite(value)
    if known.mean() < OBSERVED_SHARE:
        return None
    shown, claimed = (np.where(known, np.degrees(array), np.nan) for array in (value, std))
    return MovementAngle(name, label, shown, claimed, limits)
