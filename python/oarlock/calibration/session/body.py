"""`BodyKinematics`: link rotations and joint axes of a model by its coordinates, for the session's mount search."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.static.pose_mounts import rest_posture
from oarlock.model.coordinates import rotation_columns
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec, quat_inverse, right_jacobian
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.model.description import FrameDescription

TURNS = 1e-6
"""A link that turns by less than this per radian does not turn with a coordinate."""


@dataclass(frozen=True, eq=False)
class BodyKinematics:
    """A model and the frames of the units under search.

    Args:
        model: the body.
        units: their names.
        frames: unit -> index of its frame.
        turns_with: unit -> coordinates that turn its link.
        joints: joint -> its coordinates that turn.
        carriers: joint and unit below it -> the frame that carries the joint on the way to the unit.
        up: (3,) unit vector, root axes.
        forward: (3,) level unit vector, root axes.
    """

    model: Model
    units: tuple[str, ...]
    frames: Mapping[str, int]
    turns_with: Mapping[str, frozenset[str]]
    joints: Mapping[str, tuple[str, ...]]
    carriers: Mapping[tuple[str, str], str]
    up: Floats
    forward: Floats

    @classmethod
    def of(cls, model: Model, units: Sequence[str]) -> BodyKinematics:
        """Probes in a posture away from singular ones which coordinate turns which link."""
        told = model.describe()
        frame_of = {s.name: s.frame for s in told.inertial_units}
        frames = {name: model.frame_names.index(frame_of[name]) for name in units}
        joints = {
            j.name: tuple(c for c in j.coordinates if not c.endswith((".x", ".y", ".z")))
            for j in told.joints
            if j.kind != "slide"
        }
        names = model.coordinate_names
        q = rest_posture(model, None) + 0.1 * np.sin(1.0 + np.arange(len(names)))
        by_coordinate = model.frame_jacobian(q).by_coordinate
        turns: dict[str, frozenset[str]] = {}
        for unit, frame in frames.items():
            turned = np.abs(by_coordinate[frame, 3:]).max(axis=0)
            turns[unit] = frozenset(n for n, t in zip(names, turned, strict=True) if t > TURNS)
        up, forward = np.asarray(told.world.up), np.asarray(told.world.forward)
        carriers = {
            (joint, name): parent
            for name in units
            for joint, parent in _carriers(told.frames, frame_of[name]).items()
        }
        return cls(model, tuple(units), frames, turns, joints, carriers, up, forward)

    def posture(self, pose: Mapping[str, float]) -> Floats:
        """(n,) coordinates, the rest posture where the pose names none."""
        return rest_posture(self.model, dict(pose) or None)

    def root_from_link(self, unit: str, q: Floats) -> Floats:
        """(..., 3, 3) at postures (..., n)."""
        return np.asarray(self.model.forward_kinematics(q)[..., self.frames[unit], :3, :3])

    def above(self, joint: str, child: str) -> str | None:
        """The nearest unit on the other side of a joint, seen from a unit below it; None is the root."""
        turning = set(self.joints[joint])
        return self.unit_above(child, (u for u in self.units if not turning & self.turns_with[u]))

    def unit_above(self, child: str, among: Iterable[str]) -> str | None:
        """The nearest of some units on the way from a unit to the root; None if there is none."""
        others = [u for u in among if self.turns_with[u] < self.turns_with[child]]
        return max(others, key=lambda u: len(self.turns_with[u]), default=None)

    def below(self, joint: str) -> list[str]:
        """The nearest units that a joint turns: without another one between it and them."""
        turning = set(self.joints[joint])
        moved = [u for u in self.units if turning <= self.turns_with[u]]
        return [u for u in moved if not any(self.turns_with[v] < self.turns_with[u] for v in moved)]

    def axis_in_link(self, joint: str, about: Floats | None, child: str, q: Floats) -> tuple[Floats, Floats]:
        """Unit axis (3,) about which a joint turns, in a link's axes, and its derivatives (n, 3) by all coordinates.

        The axis is constant in the frame that carries the joint, so that only the angular velocities of this frame and
        of the link enter.

        Args:
            joint: above the link.
            about: (3,) axis in the frame that carries the joint; None is a hinge's own.
            child: unit on the link.
            q: (n,) posture.
        """
        own = self.model.frame_names[self.frames[child]]
        names = [self.carriers[joint, child], own]
        carrier_turns, own_turns = self.model.frame_jacobian(q, names).by_coordinate[:, 3:]
        columns = [self.model.coordinate_names.index(c) for c in self.joints[joint]]
        axis = own_turns[:, columns[0]]
        if about is not None:
            # The columns of a ball joint are rotations about its child's axes.
            child_from_carrier = matrix_from_quat(quat_inverse(quat_from_rotvec(q[columns])))
            axis = own_turns[:, columns] @ child_from_carrier @ about
        axis = axis / np.linalg.norm(axis)
        turns = carrier_turns - own_turns
        for columns in rotation_columns(self.model.coordinate_names):
            turns[:, columns] = turns[:, columns] @ right_jacobian(q[columns])
        link_from_root = self.root_from_link(child, q).T
        return link_from_root @ axis, np.cross(turns.T, axis) @ link_from_root.T


def _carriers(described: Sequence[FrameDescription], frame: str) -> dict[str, str]:
    """Joint -> the frame that carries it, of all joints from a frame to the root; of a repeated joint the nearest."""
    frames = {f.name: f for f in described}
    found: dict[str, str] = {}
    here = frames[frame]
    while here.parent is not None:
        if here.joint is not None:
            found.setdefault(here.joint, here.parent)
        here = frames[here.parent]
    return found
