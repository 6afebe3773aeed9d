"""Angles of a body's joints under the names of the field, for reports and exports: `hip_flexion_r`, `pelvis_tilt`.

Joints of three hinges have these angles as coordinates: Z, X, Y, as the International Society of Biomechanics says for
hip and ankle (Wu et al. 2002, J. Biomech. 35, 543-548), elbow and wrist (Wu et al. 2005, J. Biomech. 38, 981-992), and
Grood and Suntay 1983 for the knee. This module adds those of the ball joints. A left limb is taken as the mirror image
of a right one, as the society advises, so that signs mean the same on both sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from oarlock.model.angle_sequence import angle_stds, angles_from_quat, near_singular
from oarlock.model.coordinates import joint_columns
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.tracking.joint_series import BallSeries, FreeSeries

if TYPE_CHECKING:
    from oarlock.tracking.track import Track


@dataclass(frozen=True, eq=False)
class JointAngle:
    """One angle over time.

    Args:
        name: such as `knee_flexion_r`.
        angle_rad: (T,), continuous; NaN where not estimated.
        std_rad: (T,), unbounded near a singularity.
        observed: (T,) true where sensors determine it.
        near_singular: (T,) true where the angle, not the rotation, is unreliable.
    """

    name: str
    angle_rad: Floats
    std_rad: Floats
    observed: Bools
    near_singular: Bools


@dataclass(frozen=True)
class NamedRotation:
    """Names, signs and offsets of the angles of a ball joint.

    Args:
        sequence: such as "YXY".
        names: of its three angles, or of the middle one alone: the angle between the long axes of both segments.
        signs, offsets_rad: sign * angle + offset is what the name means.
        is_mirrored: of a left limb, which is taken as the mirror image of a right one.
    """

    sequence: str
    names: tuple[str, ...]
    signs: tuple[float, float, float] = (1.0, 1.0, 1.0)
    offsets_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_mirrored: bool = False

    def rotation(self, quat_wxyz: Floats) -> Floats:
        """Rotations (T, 4) of the joint as the names count them."""
        return quat_wxyz * [1.0, -1.0, -1.0, 1.0] if self.is_mirrored else quat_wxyz


_SHOULDER: Final = {
    # The society counts elevation about -X; this is the triple across the pole of the one with a positive middle angle.
    "YXY": NamedRotation("YXY", ("plane", "elevation", "rotation"), offsets_rad=(np.pi, 0.0, -np.pi)),
    "XZY": NamedRotation("XZY", ("abduction", "flexion", "rotation"), (-1.0, 1.0, 1.0)),
    "ZXY": NamedRotation("ZXY", ("flexion", "abduction", "rotation"), (1.0, -1.0, 1.0)),
}
# Baker 2001, Human Movement Science 20, 859-860: rotation first, so that the others are those of the clinic
_IN_THE_ROOM: Final = NamedRotation("YXZ", ("rotation", "obliquity", "tilt"), (1.0, -1.0, -1.0))
# The middle angle of YXY is well defined near its poles too.
_BEND: Final = "YXY"


def named_rotation(joint: str, is_free: bool, shoulder: str = "YXY") -> NamedRotation | None:
    """How the angles of a ball or free joint of the shipped bodies are named; None for other names.

    Args:
        joint: its name.
        is_free: whether it is a free joint.
        shoulder: sequence of a shoulder, as for `joint_angles`.
    """
    if is_free:
        return replace(_IN_THE_ROOM, names=tuple(f"{joint}_{name}" for name in _IN_THE_ROOM.names))
    stem, _, side = joint.rpartition("_")
    if side not in ("r", "l"):
        return None
    if stem == "shoulder":
        named = _SHOULDER[shoulder]
        names = tuple(f"shoulder_{name}_{side}" for name in named.names)
        return replace(named, names=names, is_mirrored=side == "l")
    return NamedRotation(_BEND, (f"elbow_flexion_{side}",)) if stem == "elbow" else None


def joint_angles(track: Track, shoulder: str = "YXY") -> dict[str, JointAngle]:
    """Angles of a shipped body by name; docs/bodies.md explains them.

    Args:
        track: of a body such as "full_body".
        shoulder: "YXY", "XZY" or "ZXY" (Phadke et al. 2011); another sequence is a DataError.
    """
    if shoulder not in _SHOULDER:
        raise DataError(f"shoulder: {shoulder!r}; expected {', '.join(_SHOULDER)}")
    return {
        angle.name: angle
        for joint in joint_columns(track.coordinate_names)
        for angle in _angles(track, joint, shoulder)
    }


def _angles(track: Track, joint: str, shoulder: str) -> Iterator[JointAngle]:
    series = track[joint]
    if isinstance(series, BallSeries):
        named = named_rotation(joint, isinstance(series, FreeSeries), shoulder)
        if named is not None:
            yield from _bend(series, *named.names) if len(named.names) == 1 else _named(series, named)
    elif series.unit == "rad":
        never = np.zeros(len(series.value), bool)
        yield JointAngle(joint, series.value, series.std, series.observed, never)


def _bend(series: BallSeries, name: str) -> Iterator[JointAngle]:
    angles = angles_from_quat(series.quat_wxyz, _BEND)
    stds = angle_stds(angles, _BEND, series.std_rad)
    never = np.zeros(len(angles), bool)
    yield JointAngle(name, np.arccos(np.cos(angles[:, 1])), stds[:, 1], series.observed, never)


def _named(series: BallSeries, named: NamedRotation) -> Iterator[JointAngle]:
    quat = named.rotation(series.quat_wxyz)
    angles = angles_from_quat(quat, named.sequence)
    stds = angle_stds(angles, named.sequence, series.std_rad)
    near = near_singular(quat, named.sequence)
    for k, name in enumerate(named.names):
        value = named.signs[k] * angles[:, k] + named.offsets_rad[k]
        there = value[np.isfinite(value)]
        turns = np.round(np.median(there) / (2.0 * np.pi)) if there.size else 0.0
        yield JointAngle(name, value - 2.0 * np.pi * turns, stds[:, k], series.observed, near)
