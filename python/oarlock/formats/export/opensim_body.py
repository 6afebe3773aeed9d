"""Builds an OpenSim model from a model's tree: one body per frame, one joint per body.

The pose of a frame in its parent is (before M after); M is a rotation about z, or a translation along z, by the joint's
value times a sign. OpenSim's pins rotate about z and its sliders move along x by the value itself. So each joint has
its own axes Q with M = Q N Q', where N is OpenSim's movement. If the sign is negative, Q reverses z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from oarlock._core import Model
from oarlock.formats.export.angle_box import angle_box
from oarlock.formats.export.plain_names import PlainNames, plain_name
from oarlock.formats.osim import GROUND, Kind, OsimBody, OsimCoordinate, OsimJoint, OsimModel
from oarlock.model.angle_sequence import angle_labels, angles_from_quat
from oarlock.model.coordinates import JointPart, parts
from oarlock.model.description import FrameDescription, JointDescription, pose_of
from oarlock.model.rotation import quat_from_rotvec
from oarlock.storage.arrays import Floats

SEQUENCE: Final = "XYZ"
"""Order of the angles of ball and free joints in OpenSim's files."""
_TURN: Final = (-np.pi, np.pi)
_SHIFT_M: Final = (-2.0, 2.0)


@dataclass(frozen=True)
class CoordinateSource:
    """The source of a coordinate of the OpenSim model.

    Args:
        name: name in OpenSim.
        part: part of a joint of Oarlock: a value, a position or a rotation.
        axis: index of one of the part's three numbers or angles; 0 for a value.
    """

    name: str
    part: JointPart
    axis: int


@dataclass(frozen=True, eq=False)
class OpensimBody:
    """An OpenSim model, and its relation to Oarlock's model.

    Args:
        osim: contents of the file.
        coordinates: coordinates of all its joints in their order, including coupled ones.
        frames: name of the body, and of the marker at its origin, by the name of Oarlock's frame.
    """

    osim: OsimModel
    coordinates: tuple[CoordinateSource, ...]
    frames: Mapping[str, str]


def opensim_body(model: Model, ground_from_root: Floats) -> OpensimBody:
    """The OpenSim model of `model`, whose root lies in OpenSim's ground at `ground_from_root` (4, 4)."""
    tree = _Tree(model)
    tree.weld("root_in_ground", GROUND, "root", ground_from_root)
    for frame in tree.description.frames[1:]:
        tree.add(frame)
    return tree.finished(ground_from_root)


class _Tree:
    """Builds the model body by body, parents first."""

    def __init__(self, model: Model) -> None:
        self.description = model.describe()
        frames = self.description.frames
        self.body_names = PlainNames([GROUND])
        self.bodies = {frame.name: self.body_names.give(frame.name) for frame in frames}
        self.joint_names, self.coordinate_names = PlainNames(), PlainNames()
        self.described = {joint.name: joint for joint in self.description.joints}
        self.parts: dict[str, list[JointPart]] = {}
        for part in parts(model.coordinate_names):
            self.parts.setdefault(part.joint, []).append(part)
        self.twins = _twins(frames)
        self.joints: list[OsimJoint] = []
        self.bones: dict[str, list[tuple[Floats, Floats]]] = {}
        self.sources: list[CoordinateSource] = []
        self.couplers: list[tuple[str, str]] = []
        self.first: dict[str, list[str]] = {}
        self.moved: dict[tuple[Any, ...], str] = {}

    def weld(self, name: str, parent: str, frame: str, parent_from_frame: Floats) -> None:
        given = self.joint_names.give(name)
        child = self.bodies[frame]
        self.joints.append(OsimJoint(given, "weld", parent, child, parent_from_frame, np.eye(4)))
        if parent != GROUND:
            self._bone(parent, np.zeros(3), parent_from_frame[:3, 3])

    def add(self, frame: FrameDescription) -> None:
        parent, name, joint = self.bodies[frame.parent or ""], frame.name, frame.joint
        before, after = pose_of(frame.before), pose_of(frame.after)
        if joint is None or self.described[joint].kind == "fixed":
            self.weld(f"{name}_weld", parent, name, before @ after)
            return
        if len(self.twins[_twin_key(frame)]) == 1:
            self._move(joint, frame.sign, parent, self.bodies[name], before, after)
            return
        key = _twin_key(frame)
        if key not in self.moved:
            self.moved[key] = self.body_names.give(f"{joint}_moved")
            self._move(joint, frame.sign, parent, self.moved[key], before, np.eye(4))
        self.weld(f"{name}_weld", self.moved[key], name, after)

    def _move(self, joint: str, sign: float, parent: str, child: str, before: Floats, after: Floats) -> None:
        kind, axes = _kind_and_axes(self.described[joint].kind, sign)
        child_from_joint = np.linalg.inv(after) @ axes
        coordinates = self._coordinates(joint, child)
        again = joint in self.first
        name = self.joint_names.give(f"{joint}_{child}" if again else joint)
        self.joints.append(OsimJoint(name, kind, parent, child, before @ axes, child_from_joint, coordinates))
        given = [coordinate.name for coordinate in coordinates]
        first = self.first.setdefault(joint, given)
        self.couplers += zip(first, given, strict=True) if again else ()
        self._bone(parent, np.zeros(3), before[:3, 3])
        self._bone(child, child_from_joint[:3, 3], np.zeros(3))

    def _coordinates(self, joint: str, child: str) -> tuple[OsimCoordinate, ...]:
        found = []
        # OpenSim lists the angles of a joint before its translations
        for part in sorted(self.parts[joint], key=lambda part: part.kind == "position"):
            for axis, label in enumerate(_labels(part)):
                wanted = f"{joint}_{label}" if label else joint
                name = self.coordinate_names.give(f"{wanted}_{child}" if joint in self.first else wanted)
                self.sources.append(CoordinateSource(name, part, axis))
                default, span = _default(self.described[joint], part, axis)
                found.append(OsimCoordinate(name, default, span))
        return tuple(found)

    def _bone(self, body: str, start: Floats, end: Floats) -> None:
        self.bones.setdefault(body, []).append((start, end))

    def finished(self, ground_from_root: Floats) -> OpensimBody:
        world, name = self.description.world, self.description.name
        down = -world.gravity_m_s2 * (ground_from_root[:3, :3] @ np.asarray(world.up))
        bodies = tuple(
            OsimBody(joint.child, np.array(self.bones.get(joint.child, [])).reshape(-1, 2, 3))
            for joint in self.joints
        )
        osim = OsimModel(
            name=plain_name(name),
            credits=f"Written by Oarlock from the model {plain_name(name)}.",
            gravity_m_s2=(float(down[0]), float(down[1]), float(down[2])),
            bodies=bodies,
            joints=tuple(self.joints),
            couplers=tuple(self.couplers),
            markers=tuple((body, body) for body in self.bodies.values()),
        )
        return OpensimBody(osim, tuple(self.sources), self.bodies)


def _twin_key(frame: FrameDescription) -> tuple[Any, ...]:
    before = (pose_of(frame.before) + 0.0).tobytes()  # converts -0 to 0
    return (frame.parent, frame.joint, frame.sign, before)


def _twins(frames: Sequence[FrameDescription]) -> dict[tuple[Any, ...], list[str]]:
    """Frames that move together: same joint, same parent, same joint position, same sign."""
    found: dict[tuple[Any, ...], list[str]] = {}
    for frame in frames:
        found.setdefault(_twin_key(frame), []).append(frame.name)
    return found


def _kind_and_axes(kind: str, sign: float) -> tuple[Kind, Floats]:
    """OpenSim's joint for a joint of Oarlock, and its axes Q (4, 4) in that joint's axes."""
    axes = np.eye(4)
    if kind == "hinge":
        axes[1, 1] = axes[2, 2] = sign
        return "pin", axes
    if kind == "slide":
        # the slider's x is along z times the sign
        axes[:3, :3] = np.array([[0.0, 0.0, -sign], [0.0, 1.0, 0.0], [sign, 0.0, 0.0]])
        return "slider", axes
    return "custom", axes


def _labels(part: JointPart) -> Sequence[str]:
    if part.kind == "scalar":
        return ("",)
    position = part.kind == "position"
    return [f"t{axis}" for axis in "xyz"] if position else [f"{SEQUENCE}_{a}" for a in angle_labels(SEQUENCE)]


def _default(joint: JointDescription, part: JointPart, axis: int) -> tuple[float, tuple[float, float]]:
    """Rest value and slider range of one coordinate."""
    rest = np.ravel(joint.rest)
    if part.kind == "scalar":
        low, high = joint.limits
        return float(rest[0]), (low, high)
    if part.kind == "position":
        return float(rest[axis]), _SHIFT_M
    angles = angles_from_quat(quat_from_rotvec(rest[None, -3:]), SEQUENCE)
    low, high = angle_box(joint.cone, rest)[axis].tolist() if joint.cone else _TURN
    return float(angles[0, axis]), (low, high)
