"""Angles of a body's joints under the names of the field, for reports and exports: `hip_flexion_r`, `pelvis_tilt`.

Joints of three hinges have these angles as coordinates: Z, X, Y, as the International Society of Biomechanics says for
hip and ankle (Wu et al. 2002, J. Biomech. 35, 543-548), elbow and wrist (Wu et al. 2005, J. Biomech. 38, 981-992), and
Grood and Suntay 1983 for the knee. This module adds those of the ball joints. A left limb is taken as the mirror image
of a right one, as the society advises, so that signs mean the same on both sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from oarlock.model.angle_sequence import angle_stds, angles_from_quat, near_singular
from oarlock.model.coordinates import joint_columns
from oarlock.storage.errors import DataError
from oarlock.tracking.joint_series import BallSeries, FreeSeries

if TYPE_CHECKING:
    from oarlock.tracking.track import Track

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class JointAngle:
    """One angle over time.

    Args:
        name: such as `knee_flexion_r`.
        angle_rad: (T,), continuous over time; NaN where not estimated.
        std_rad: (T,) standard deviation. Near a singular pose of the sequence it grows without bound.
        observed: (T,) true where the sensors determine the joint.
        near_singular: (T,) true where the angle, not the rotation, is unreliable.
    """

    name: str
    angle_rad: Floats
    std_rad: Floats
    observed: Bools
    near_singular: Bools


@dataclass(frozen=True)
class _Named:
    """Names, signs and offsets of the three angles of a sequence."""

    sequence: str
    names: tuple[str, str, str]
    signs: tuple[float, float, float] = (1.0, 1.0, 1.0)
    offsets_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


_SHOULDER: Final = {
    # The society counts elevation about -X; this is the triple across the pole of the one with a positive middle angle.
    "YXY": _Named("YXY", ("plane", "elevation", "rotation"), offsets_rad=(np.pi, 0.0, -np.pi)),
    "XZY": _Named("XZY", ("abduction", "flexion", "rotation"), (-1.0, 1.0, 1.0)),
    "ZXY": _Named("ZXY", ("flexion", "abduction", "rotation"), (1.0, -1.0, 1.0)),
}
# Baker 2001, Human Movement Science 20, 859-860: rotation first, so that the others are those of the clinic
_IN_THE_ROOM: Final = _Named("YXZ", ("rotation", "obliquity", "tilt"), (1.0, -1.0, -1.0))


def joint_angles(track: Track, shoulder: str = "YXY") -> dict[str, JointAngle]:
    """All angles of a track of one of the shipped bodies, by name.

    Hinges keep their names. A shoulder gives `shoulder_plane_r`, `shoulder_elevation_r` and `shoulder_rotation_r`; the
    free segment `pelvis_rotation`, `pelvis_obliquity` and `pelvis_tilt` (or `thorax_...`). An elbow that is a ball
    (`with_ball_joint`) gives only `elbow_flexion_r`, the angle between both segments.
    docs/bodies.md has the signs.

    Args:
        track: of a body such as "full_body"; ball joints under other names are left out.
        shoulder: "YXY" as the society says, singular while the arm hangs; "XZY" (Phadke et al. 2011) singular with
            the arm forward and level, or "ZXY" singular with the arm sideways and level: abduction, flexion, rotation.

    Raises:
        DataError: another sequence.
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
    if isinstance(series, FreeSeries):
        yield from _named(series, _IN_THE_ROOM, f"{joint}_", "")
    elif isinstance(series, BallSeries):
        stem, _, side = joint.rpartition("_")
        if stem == "shoulder" and side in ("r", "l"):
            yield from _named(series, _SHOULDER[shoulder], "shoulder_", f"_{side}")
        elif stem == "elbow" and side in ("r", "l"):
            yield _bend(series, f"elbow_flexion_{side}")
    elif series.unit == "rad":
        never = np.zeros(len(series.value), bool)
        yield JointAngle(joint, series.value, series.std, series.observed, never)


def _bend(series: BallSeries, name: str) -> JointAngle:
    """The angle between the long axes: the middle one of YXY, which is well defined near its poles too."""
    angles = angles_from_quat(series.quat_wxyz, "YXY")
    stds = angle_stds(angles, "YXY", series.std_rad)
    never = np.zeros(len(angles), bool)
    return JointAngle(name, np.arccos(np.cos(angles[:, 1])), stds[:, 1], series.observed, never)


def _named(series: BallSeries, named: _Named, before: str, after: str) -> Iterator[JointAngle]:
    quat = series.quat_wxyz * ([1.0, -1.0, -1.0, 1.0] if after == "_l" else [1.0, 1.0, 1.0, 1.0])
    angles = angles_from_quat(quat, named.sequence)
    stds = angle_stds(angles, named.sequence, series.std_rad)
    near = near_singular(quat, named.sequence)
    for k, name in enumerate(named.names):
        value = named.signs[k] * angles[:, k] + named.offsets_rad[k]
        there = value[np.isfinite(value)]
        turns = np.round(np.median(there) / (2.0 * np.pi)) if there.size else 0.0
        yield JointAngle(
            f"{before}{name}{after}", value - 2.0 * np.pi * turns, stds[:, k], series.observed, near
        )
