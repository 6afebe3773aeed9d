"""`Body`: link rotations and joint axes of a model as functions of its coordinates, for the session's mount search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.static.pose_mounts import rest_posture
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec, quat_inverse
from oarlock.storage.array_gate import FloatArray

if TYPE_CHECKING:
    from oarlock._core import Model

STEP_RAD = 1e-4
TURNS = 1e-6
"""A link that turns by less than this per radian does not turn with a coordinate."""


@dataclass(frozen=True, eq=False)
class Body:
    """A model and the frames of the units under search.

    Args:
        model: the body.
        units: their names.
        frames: unit -> index of its frame.
        turns_with: unit -> coordinates that turn its link.
        joints: joint -> its coordinates that turn.
        up: (3,) unit vector, root axes.
        forward: (3,) level unit vector, root axes.
    """

    model: Model
    units: tuple[str, ...]
    frames: Mapping[str, int]
    turns_with: Mapping[str, frozenset[str]]
    joints: Mapping[str, tuple[str, ...]]
    up: FloatArray
    forward: FloatArray

    @classmethod
    def of(cls, model: Model, units: Sequence[str]) -> Body:
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
        return cls(model, tuple(units), frames, turns, joints, up, forward)

    def posture(self, pose: Mapping[str, float]) -> FloatArray:
        """(n,) coordinates, the rest posture where the pose names none."""
        return rest_posture(self.model, dict(pose) or None)

    def root_from_link(self, unit: str, q: FloatArray) -> FloatArray:
        """(..., 3, 3) at postures (..., n)."""
        return np.asarray(self.model.forward_kinematics(q)[..., self.frames[unit], :3, :3])

    def above(self, joint: str, child: str) -> str | None:
        """The nearest unit on the other side of a joint, seen from a unit below it; None is the root."""
        turning = set(self.joints[joint])
        others = [
            u
            for u in self.units
            if not turning & self.turns_with[u] and self.turns_with[u] < self.turns_with[child]
        ]
        return max(others, key=lambda u: len(self.turns_with[u]), default=None)

    def below(self, joint: str) -> list[str]:
        """The nearest units that a joint turns: without another one between it and them."""
        turning = set(self.joints[joint])
        moved = [u for u in self.units if turning <= self.turns_with[u]]
        return [u for u in moved if not any(self.turns_with[v] < self.turns_with[u] for v in moved)]

    def axis(self, joint: str, about: FloatArray | None, child: str, q: FloatArray) -> FloatArray:
        """(..., 3) unit axis in root axes about which a joint turns a link, at postures (..., n)."""
        frame = self.model.frame_names[self.frames[child]]
        columns = [self.model.coordinate_names.index(c) for c in self.joints[joint]]
        turns = self.model.frame_jacobian(q, [frame]).by_coordinate[..., 0, 3:, :][..., columns]
        if about is None:
            turn = turns[..., 0]
        else:
            # columns are turns about the child's axes, the plan names an axis of the parent
            in_child = matrix_from_quat(quat_inverse(quat_from_rotvec(q[..., columns]))) @ about
            turn = np.einsum("...ij,...j->...i", turns, in_child)
        return np.asarray(turn / np.linalg.norm(turn, axis=-1, keepdims=True))

    def slopes(self, q: FloatArray) -> FloatArray:
        """(2n, n) postures a step before and behind along each coordinate, for central differences."""
        steps = STEP_RAD * np.eye(len(q))
        return np.concatenate([q + steps, q - steps])
