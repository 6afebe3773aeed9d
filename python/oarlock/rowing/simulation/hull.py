"""A simulated hull with prescribed rotations, and models whose root does not rotate with the boat.

The sculler's root is the boat. Where the boat turns, the root becomes a frame that travels along, level and straight
on, and everything that hung on the root hangs on a frame `hull`. The hull strays from the root by two slides,
`hull_sway` (X) and `hull_heave` (Y), and turns by three hinges: `hull_yaw` about the vertical (positive with the bow
toward the rower's right, port), then `hull_pitch` about the transverse axis (positive with the stern down), then
`hull_roll` about the keel (positive with the rower's left, starboard, up).
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from math import radians
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from oarlock.model.edit import document_of, merged, model_of
from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.simulation.motion import Motion
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock import Model

Array = NDArray[np.float64]

HULL_ANGLES = ("hull_yaw", "hull_pitch", "hull_roll")
HULL_JOINTS = ("hull_sway", "hull_heave", *HULL_ANGLES)
_WIDEST_RAD = radians(30.0)
_HARMONICS = (1.0, 0.4, 0.2)
_GRID = np.arange(512) / 512.0
_SLOW = 4.0

_JOINTS_AND_FRAMES = """
[[joint]]
name = "hull_sway"
kind = "slide"

[[joint]]
name = "hull_heave"
kind = "slide"
[[joint]]
name = "hull_yaw"
kind = "hinge"

[[joint]]
name = "hull_pitch"
kind = "hinge"

[[joint]]
name = "hull_roll"
kind = "hinge"

[[frame]]
name = "hull_swayed"
parent = "root"
transform = { translation = [0, 0, 0] }
axis = "x"
joint = "hull_sway"

[[frame]]
name = "hull_heaved"
parent = "hull_swayed"
transform = { translation = [0, 0, 0] }
axis = "y"
joint = "hull_heave"

[[frame]]
name = "hull_yawed"
parent = "hull_heaved"
transform = { translation = [0, 0, 0] }
axis = "y"
joint = "hull_yaw"

[[frame]]
name = "hull_pitched"
parent = "hull_yawed"
transform = { translation = [0, 0, 0] }
axis = "x"
joint = "hull_pitch"

[[frame]]
name = "hull"
parent = "hull_pitched"
transform = { translation = [0, 0, 0] }
axis = "z"
joint = "hull_roll"
"""


@dataclass(frozen=True)
class HullRotation:
    """Small rotations of the hull within strokes, zero on average.

    The part that repeats with the stroke swings from minus to plus the given amplitude (half of peak to peak). Pitch
    has the stern down at the catch, where the rower sits sternmost; roll and yaw have a shape that the seed chooses,
    three harmonics of the stroke. A random part is added, half of it from stroke to stroke, half over several strokes.

    Usual amplitudes are the defaults; Formaggia et al. 2009 and Mola 2010, as the sculler's source reads them, bound
    pitch, roll and yaw within a stroke by 1, 5 and 5 deg.

    Attributes:
        pitch_rad, roll_rad, yaw_rad: amplitudes, rad.
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

    def angles(self, timing: StrokeTiming, rng: np.random.Generator) -> dict[str, Array]:
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


def turning_hull(motion: Motion, angles: dict[str, Array], pivot_m: Array, shifted_m: Array) -> Motion:
    """The same motion in a hull that turns about a point of its own.

    Args:
        motion: of a model with the hull's joints, at any values; its base acceleration acts along Z.
        angles: (K,) at the motion's knots, rad, by hull joint; those left out are zero.
        pivot_m: (3,) the point about which the hull turns, in hull axes, m.
        shifted_m: (K,) part of the way along Z that the hull makes under the shifting rower, m: this part goes along
            the keel, wherever it points, the rest of the base acceleration along the course.

    The hull's origin lies beside the pivot, so that it sways, heaves and surges with the rotation.
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


def _turned(yaw: Array, pitch: Array, roll: Array, arm: Array) -> Array:
    """Ry(yaw) Rx(pitch) Rz(roll) arm, (K, 3)."""
    x = np.cos(roll) * arm[0] - np.sin(roll) * arm[1]
    y = np.sin(roll) * arm[0] + np.cos(roll) * arm[1]
    y, z = np.cos(pitch) * y - np.sin(pitch) * arm[2], np.sin(pitch) * y + np.cos(pitch) * arm[2]
    return np.stack([np.cos(yaw) * x + np.sin(yaw) * z, y, np.cos(yaw) * z - np.sin(yaw) * x], axis=-1)


def on_hull(model: Model) -> Model:
    """The model with everything that hung on the root hung on a hull that turns in it; itself if it has one.

    For simulating what the sensors of any boat's model feel when the boat turns; see the model `sculler_boat` for
    tracking.
    """
    if set(HULL_JOINTS) <= set(model.joint_names):
        return model
    document = document_of(model)
    for table in (table for kind in ("frame", "sensor", "closure") for table in document.get(kind, ())):
        for key in ("parent", "frame", "frame_a", "frame_b"):
            if table.get(key) == "root":
                table[key] = "hull"
    return model_of(merged(document, tomllib.loads(_JOINTS_AND_FRAMES)), model)
