"""Simulated hulls with prescribed rotations, and models whose root does not rotate with the boat.

The root then travels level and straight. It carries the frame `hull` by the slides `hull_sway` (X) and `hull_heave`
(Y) and the hinges `hull_yaw` (positive: bow to port), `hull_pitch` (stern down) and `hull_roll` (starboard up).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from oarlock.model.edit import document_of, merged, model_of, moving_frame
from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock import Model


HULL_ANGLES = ("hull_yaw", "hull_pitch", "hull_roll")
HULL_JOINTS = ("hull_sway", "hull_heave", *HULL_ANGLES)
_WIDEST_RAD = radians(30.0)
_HARMONICS = (1.0, 0.4, 0.2)
_GRID = np.arange(512) / 512.0
_SLOW = 4.0

_STEPS = (
    ("hull_swayed", "hull_sway", "slide", "x"),
    ("hull_heaved", "hull_heave", "slide", "y"),
    ("hull_yawed", "hull_yaw", "hinge", "y"),
    ("hull_pitched", "hull_pitch", "hinge", "x"),
    ("hull", "hull_roll", "hinge", "z"),
)
"""Frames from the root to the hull, each with the name, kind and axis of its joint."""


@dataclass(frozen=True)
class HullRotation:
    """Small rotations of the hull within strokes, zero on average.

    Each angle is periodic with the stroke, plus a random part. Pitch has the stern down at the catch; roll and yaw have
    three harmonics with random phases. Defaults are usual values; Formaggia et al. 2009 and Mola 2010 bound pitch, roll
    and yaw within a stroke by 1, 5 and 5 deg.

    Attributes:
        pitch_rad, roll_rad, yaw_rad: amplitudes (half of peak to peak), rad.
        irregular: standard deviation of the random part as a share of the amplitude.
    """

    pitch_rad: float = radians(0.3)
    roll_rad: float = radians(1.5)
    yaw_rad: float = radians(0.5)
    irregular: float = 0.3

    def __post_init__(self) -> None:
        for name in ("pitch_rad", "roll_rad", "yaw_rad"):
            if not 0.0 <= getattr(self, name) <= _WIDEST_RAD:
                raise DataError(
                    f"hull rotation: {name} is {getattr(self, name)}; give an amplitude of 0 to {_WIDEST_RAD:.2f} rad "
                    "(30 deg); 0.3 to 5 deg are 0.005 to 0.09 rad"
                )
        if not 0.0 <= self.irregular <= 2.0:
            raise DataError(
                f"hull rotation: irregular is {self.irregular}; give 0 (every stroke the same) to 2"
            )

    def angles(self, timing: StrokeTiming, rng: np.random.Generator) -> dict[str, Floats]:
        """Angles (K,) of `hull_yaw`, `hull_pitch` and `hull_roll`, rad."""
        amplitudes = {"hull_yaw": self.yaw_rad, "hull_pitch": self.pitch_rad, "hull_roll": self.roll_rad}
        every, slow = Variation(rng, timing.stroke), Variation(rng, timing.stroke / _SLOW)
        angles = {}
        for name, amplitude in amplitudes.items():
            locked = _stroke_shape(rng, in_step=name == "hull_pitch")(timing.stroke)
            random = (every.draw(1.0) + slow.draw(1.0)) / np.sqrt(2.0)
            angles[name] = amplitude * (locked + self.irregular * random)
        return angles


def _stroke_shape(rng: np.random.Generator, in_step: bool) -> PeriodicCurve:
    turns = np.exp(2j * np.pi * rng.uniform(size=len(_HARMONICS)))
    sizes = np.array([0.0, *_HARMONICS])
    series = sizes * np.array([0.0, *(np.ones_like(turns) if in_step else turns)])
    values = PeriodicCurve(series)(_GRID)
    return PeriodicCurve(series / (0.5 * np.ptp(values)))


def turning_hull(motion: Motion, angles: dict[str, Floats], pivot_m: Floats, shifted_m: Floats) -> Motion:
    """The same motion in a hull that rotates about a pivot; its origin then sways, heaves and surges.

    Args:
        motion: of a model with the hull's joints, at any values; its base acceleration acts along Z.
        angles: (K,) at the motion's knots, rad, by hull joint; those left out are zero.
        pivot_m: (3,) the point about which the hull turns, in hull axes, m.
        shifted_m: (K,) displacement of the hull along its keel due to the moving rower, m; the rest of the base
            acceleration acts along the course.
    """
    zero = np.zeros(motion.time_s.size)
    yaw, pitch, roll = (np.asarray(angles.get(name, zero), dtype=np.float64) for name in HULL_ANGLES)
    pivot = np.asarray(pivot_m, dtype=np.float64)
    way = pivot + _turned(yaw, pitch, roll, -pivot)
    way += np.stack([shifted_m * np.sin(yaw), zero, shifted_m * (np.cos(yaw) - 1.0)], axis=-1)
    q = motion.q.copy()
    for name, value in zip(HULL_JOINTS, (way[:, 0], way[:, 1], yaw, pitch, roll), strict=True):
        q[:, motion.joint_names.index(name)] = value
    base = np.zeros((zero.size, 3))
    base[:, 2] = make_interp_spline(motion.time_s, way[:, 2], k=5)(motion.time_s, 2)
    if motion.base_acceleration_m_s2 is not None:
        base += motion.base_acceleration_m_s2
    return Motion(motion.joint_names, motion.time_s, q, base)


def _turned(yaw: Floats, pitch: Floats, roll: Floats, arm: Floats) -> Floats:
    """Ry(yaw) Rx(pitch) Rz(roll) arm, (K, 3)."""
    x = np.cos(roll) * arm[0] - np.sin(roll) * arm[1]
    y = np.sin(roll) * arm[0] + np.cos(roll) * arm[1]
    y, z = np.cos(pitch) * y - np.sin(pitch) * arm[2], np.sin(pitch) * y + np.cos(pitch) * arm[2]
    return np.stack([np.cos(yaw) * x + np.sin(yaw) * z, y, np.cos(yaw) * z - np.sin(yaw) * x], axis=-1)


def on_hull(model: Model) -> Model:
    """The model with its root's children on a hull that rotates in it; the model itself if it has a hull.

    For simulation; to track, use the model `sculler_boat`.
    """
    if set(HULL_JOINTS) <= set(model.joint_names):
        return model
    parents = ("root", *(frame for frame, *_ in _STEPS))
    added = {
        "joint": [{"name": joint, "kind": kind} for _, joint, kind, _ in _STEPS],
        "frame": [
            moving_frame(frame, parent, axis, joint)
            for parent, (frame, joint, _, axis) in zip(parents, _STEPS, strict=False)
        ],
    }
    document = document_of(model)
    for table in (table for kind in ("frame", "sensor", "closure") for table in document.get(kind, ())):
        for key in ("parent", "frame", "frame_a", "frame_b"):
            if table.get(key) == "root":
                table[key] = "hull"
    return model_of(merged(document, added), model)
