"""`ModelDescription`: a model as plain data, which `Model.describe` returns, with one class for each of its parts.

Numbers are in SI and rad, at the values of the model or of a calibration; frames and signs as in CONVENTIONS.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    pass

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldDescription:
    """Gravity and magnetic field.

    Args:
        up: (3,) unit vector in root axes, opposite to gravity.
        forward: (3,) horizontal unit vector in root axes, from which azimuths count.
        gravity_m_s2: gravity.
        magnetic_norm_ut: norm of the magnetic field.
        magnetic_dip_rad: dip of the field below the horizon.
        magnetic_azimuth_rad: azimuth of the field from `forward`, right-handed about `up`.
        azimuth_fixed: whether the azimuth is known and not estimated.
        azimuth_walk: random walk of the azimuth, rad per sqrt(s).
    """

    up: Vector
    forward: Vector
    gravity_m_s2: float
    magnetic_norm_ut: float
    magnetic_dip_rad: float
    magnetic_azimuth_rad: float
    azimuth_fixed: bool
    azimuth_walk: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDescription:
    """A named number of the model, such as a length.

    Args:
        name: unique among parameters.
        value: its value, in `unit`.
        unit: "m", "rad" or "".
        std: prior standard deviation, in `unit`; None if unknown.
        label: what it is, for people.
    """

    name: str
    value: float
    unit: str
    std: float | None
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessDescription:
    """How a coordinate moves by itself.

    Args:
        kind: "jerk", "singer" or "walk".
        density: process noise: rad/s2 or m/s2 per sqrt(s), for "walk" rad or m per sqrt(s).
        start_std: standard deviations at the start of value, rate and acceleration (rad or m, and per s, s2); for
            "walk" of the value only.
        time_s: time constant of the acceleration's decay, for "singer".
        limits: soft limits of a free joint's position, m; None in the process of a joint, which has its own.
    """

    kind: str
    density: float
    start_std: tuple[float, ...]
    time_s: float | None = None
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConeDescription:
    """The range of a ball joint, counted from its rest: a twist about one axis of the child, then a swing of this axis.

    Args:
        axis: "x", "y" or "z" of the child.
        swing: largest swing about each of the other two axes, in the order x, y, z, rad.
        twist: least and largest twist about `axis`, rad.
    """

    axis: str
    swing: tuple[float, float]
    twist: tuple[float, float]

    def limits_about(self) -> tuple[tuple[float, float], ...]:
        """Soft limits of the three coordinates of the rotation vector from rest, rad."""
        swings = tuple((-angle, angle) for angle in self.swing)
        before = "xyz".index(self.axis)
        return (*swings[:before], self.twist, *swings[before:])


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDescription:
    """A joint.

    Args:
        name: unique among joints.
        kind: "fixed", "hinge", "slide", "ball" or "free".
        label: what it is, for people.
        coordinates: names of its coordinates, columns of `q`.
        limits: soft limits, rad or m; of a ball about each axis from `rest`, the widest ones if it has a `cone`.
        rest: rest value, rad or m; of a ball or free joint one for each coordinate.
        input: whether its value comes from a stream and is no state.
        std: standard deviation of an input's reading, rad or m; None for others.
        process: how it moves by itself, of a free joint its rotation; None if it is fixed or an input.
        angles: angle sequence such as "YXY" for reports; None for joints without a free rotation.
        translation: how a free joint's position moves; None for others.
        cone: range of a ball that differs between directions; None for others.
    """

    name: str
    kind: str
    label: str
    coordinates: tuple[str, ...]
    limits: tuple[float, float]
    rest: float | tuple[float, ...]
    input: bool
    std: float | None
    process: ProcessDescription | None
    angles: str | None
    translation: ProcessDescription | None = None
    cone: ConeDescription | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TransformDescription:
    """A constant pose of a frame in another.

    Args:
        rotation: (3, 3) rotation from the axes of the one to those of the other.
        translation: (3,) place of its origin in the other, m.
    """

    rotation: Matrix
    translation: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameDescription:
    """A frame; parent from frame is `before`, then the joint's motion, then `after`.

    Args:
        name: unique among frames; the first one is the root.
        parent: the frame that it stands on; None for the root.
        joint: the joint that moves it, or None.
        sign: +1 or -1, the sign of the joint's motion.
        before: the transform before the joint's motion; None is the identity.
        after: the transform after it; None is the identity.
    """

    name: str
    parent: str | None
    joint: str | None
    sign: float
    before: TransformDescription | None
    after: TransformDescription | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MountDescription:
    """How a sensor sits on its link.

    Args:
        rotation: (3, 3) link from sensor.
        offset: (3,) the sensor's place in the link's axes, m.
        std_rad: standard deviation of the rotation about each axis, rad.
        rigid: whether nothing soft lies under it, so that it never turns on its link.
        soft_std_rad: what soft tissue turns it about each axis, rad; part of the bands of angles, and not estimated.
    """

    rotation: Matrix
    offset: Vector
    std_rad: float
    rigid: bool
    soft_std_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorDescription:
    """What all kinds of sensors have; each kind has a class with more.

    Args:
        name: unique among sensors and closures; its stream has the same name.
        kind: "imu", "encoder", "position", "range" or "orientation".
        frame: the frame that it sits on; None for an encoder and a range.
        joint: the joint that it reads; None for others than encoders.
        std: standard deviation of an encoder's reading, rad or m.
        std_m: standard deviation of a position's or a range's reading, m.
    """

    name: str
    kind: str
    frame: str | None
    joint: str | None
    std: float | None
    std_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactDescription:
    """A point that touches the ground: while it stands, its velocity is measured as zero.

    Args:
        point: (3,) the point in the axes of the unit's frame, m.
        std_m_s: standard deviation of its velocity while it stands.
    """

    point: Vector
    std_m_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuDescription(SensorDescription):
    """An inertial unit; what it lacks is None.

    Args:
        gyro_std_rad_s: standard deviation of a reading of the gyroscope.
        accel_std_m_s2: of the accelerometer.
        mag_std_ut: of the magnetometer.
        rest_std_rad_s: of the angular velocity at detected rest; None switches the detection off.
        contact: the point of the unit's segment that touches the ground; None if none does.
        gyro_range_rad_s: range of the gyroscope; None if unknown.
        accel_range_m_s2: range of the accelerometer; None if unknown.
        mount: how it sits on its frame.
    """

    frame: str
    gyro_std_rad_s: float | None
    accel_std_m_s2: float | None
    mag_std_ut: float | None
    rest_std_rad_s: float | None
    contact: ContactDescription | None
    gyro_range_rad_s: float | None
    accel_range_m_s2: float | None
    mount: MountDescription


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderDescription(SensorDescription):
    """An encoder: `joint` and `std` are always there."""

    joint: str
    std: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionDescription(SensorDescription):
    """A position of a point in root axes.

    Args:
        point: (3,) the point in the axes of `frame`, m.
    """

    frame: str
    std_m: float
    point: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeDescription(SensorDescription):
    """A distance between two points.

    Args:
        frame_a: frame of the first point.
        point_a: (3,) the first point in its axes, m.
        frame_b: frame of the second point.
        point_b: (3,) the second point in its axes, m.
    """

    std_m: float
    frame_a: str
    point_a: Vector
    frame_b: str
    point_b: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class OrientationDescription(SensorDescription):
    """A device that gives its orientation.

    Args:
        std_rad: standard deviation of its error about each axis.
        white_std_rad: part of the error that is new in every reading.
        correlation_time_s: time constant of the other part; 0 if there is none.
        heading: "known" or "unknown".
        heading_group: sensors of one group share their heading; None if it is known.
        heading_walk: random walk of the heading, rad per sqrt(s); None if it is known.
        root_from_reference: (3, 3) root from the device's reference.
        mount: how it sits on its frame.
    """

    frame: str
    std_rad: float
    white_std_rad: float
    correlation_time_s: float
    heading: str
    heading_group: str | None
    heading_walk: float | None
    root_from_reference: Matrix
    mount: MountDescription


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosureDescription:
    """Two points, and two axes if it has them, that coincide.

    Args:
        name: unique among sensors and closures.
        frame_a: frame of the first point.
        frame_b: frame of the second point.
        point_a: (3,) the first point in the axes of `frame_a`, m.
        point_b: (3,) the second point in the axes of `frame_b`, m.
        axis_a: (3,) unit vector in the axes of `frame_a`, or None.
        axis_b: (3,) unit vector in the axes of `frame_b`, or None.
        std_m: standard deviation of the gap along each axis.
        std_axis: standard deviation of each direction cosine.
    """

    name: str
    frame_a: str
    frame_b: str
    point_a: Vector
    point_b: Vector
    axis_a: Vector | None
    axis_b: Vector | None
    std_m: float
    std_axis: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseAccelerationDescription:
    """An unmeasured acceleration of the root along one axis.

    Args:
        name: unique among base accelerations.
        label: what it is, for people.
        axis: (3,) unit vector in root axes.
        density: process noise, m/s2 per sqrt(s).
        start_std: standard deviation at the start, m/s2.
        time_s: time constant of its decay; None is a random walk.
        rise_s: rise time of a change; 0 is none.
        always: whether it is estimated even if `Config.estimate` does not name it.
    """

    name: str
    label: str
    axis: Vector
    density: float
    start_std: float
    time_s: float | None
    rise_s: float
    always: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelDescription:
    """Everything in a model, in the order of the model file.

    Args:
        name: name of the model.
        description: one sentence about it.
        path: the model file.
        world: gravity and magnetic field.
        parameters: named numbers, with their values and standard deviations.
        joints: all joints.
        frames: all frames, the root first and a parent before its children.
        sensors: all sensors, with their mounts.
        closures: all closures.
        base_acceleration: unmeasured accelerations of the root.
        state_names: names of the states with the default `Config`.
        measurement_names: names of the rows of all readings.
    """

    name: str
    description: str
    path: str
    world: WorldDescription
    parameters: tuple[ParameterDescription, ...]
    joints: tuple[JointDescription, ...]
    frames: tuple[FrameDescription, ...]
    sensors: tuple[SensorDescription, ...]
    closures: tuple[ClosureDescription, ...]
    base_acceleration: tuple[BaseAccelerationDescription, ...]
    state_names: tuple[str, ...]
    measurement_names: tuple[str, ...]

    @property
    def inertial_units(self) -> tuple[ImuDescription, ...]:
        """The sensors of kind "imu"."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, ImuDescription))

    @property
    def encoders(self) -> tuple[EncoderDescription, ...]:
        """The sensors of kind "encoder", of input joints too."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, EncoderDescription))

    @property
    def inputs(self) -> tuple[JointDescription, ...]:
        """The joints whose values come from a stream."""
        return tuple(joint for joint in self.joints if joint.input)

    def to_dict(self) -> dict[str, Any]:
        """Dictionaries, lists, texts and numbers for JSON; the keys are the fields' names, in alphabetical order."""
        plain: dict[str, Any] = _plain(self)
        return plain


def pose_of(transform: TransformDescription | None) -> Floats:
    """The transform as a pose (4, 4); None is the identity."""
    import numpy as np  # not at the top: help of verbs imports this module

    pose = np.eye(4)
    if transform is not None:
        pose[:3, :3], pose[:3, 3] = transform.rotation, transform.translation
    return pose


_SENSORS = {
    "imu": ImuDescription,
    "encoder": EncoderDescription,
    "position": PositionDescription,
    "range": RangeDescription,
    "orientation": OrientationDescription,
}
_PARTS = {
    "world": WorldDescription,
    "parameters": ParameterDescription,
    "joints": JointDescription,
    "cone": ConeDescription,
    "process": ProcessDescription,
    "translation": ProcessDescription,
    "frames": FrameDescription,
    "before": TransformDescription,
    "after": TransformDescription,
    "mount": MountDescription,
    "contact": ContactDescription,
    "closures": ClosureDescription,
    "base_acceleration": BaseAccelerationDescription,
}


@lru_cache(maxsize=8)
def described(text: str) -> ModelDescription:
    """The description that the engine writes as JSON; immutable, so that equal texts share one."""
    return ModelDescription(**{key: _typed(key, value) for key, value in json.loads(text).items()})


def _typed(key: str, value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_typed(key, item) for item in value)
    if isinstance(value, Mapping):
        part: type = _SENSORS[value["kind"]] if key == "sensors" else _PARTS[key]
        return part(**{name: _typed(name, item) for name, item in value.items()})
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if not is_dataclass(value):
        return value
    found = {field.name: (getattr(value, field.name), field.default) for field in fields(value)}
    return {name: _plain(found[name][0]) for name in sorted(found) if found[name][0] is not found[name][1]}
