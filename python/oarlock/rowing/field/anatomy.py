"""Anatomy of the field simulator beyond rigid links: gliding shoulders, bending spine, slipping fingers.

Kinematics in NumPy from a model's description, independent of the engine. Deviations are additional columns of the
posture; with all at zero the body is the model's. Limbs have the orientations of the model's joint frames. The trunk's
angle is the inclination of the line from the hip to the middle of the shoulders. So the true angles with the true
lengths give true orientations; positions from the shoulders outwards differ by the deviations.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from oarlock.model import ModelDescription, TransformDescription
from oarlock.rowing.simulation.grip import ARM_JOINTS, SIDES
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

Pose = tuple[Floats, Floats]
"""Rotation (..., 3, 3) and origin (..., 3) of a frame in root axes."""

DEVIATIONS = (
    "spine_bend",
    "trunk_twist",
    *(f"{side}_{name}" for side in SIDES for name in ("protraction", "elevation", "grip_slip", "grip_turn")),
)
"""Names of the deviations: rad (positive straightens the spine), rad, then for each side m, m, m, rad."""
# The seat's frame: x up, y toward the bow, z to the rower's right.
_UP, _BOW, _RIGHT = np.eye(3)
_NEEDED_FRAMES = (
    "seat",
    *(f"{s}_{f}" for s in SIDES for f in ("shoulder", "elbow", "wrist", "hand", "handle")),
)


class Anatomy:
    """The body with deviations.

    It can replace a model where only postures are needed. ``boat`` is the frame of the boat: the root, or the frame
    `hull` of a model whose root does not rotate with it.

    Args:
        description: `Model.describe()` of the model with the true lengths.
        grip_direction_rad: for each side, the axis across the handle about which the fingers rotate.

    Raises:
        DataError: the model lacks a frame or a joint of the sculler.
    """

    def __init__(
        self, description: ModelDescription, grip_direction_rad: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._frames = {frame.name: frame for frame in description.frames}
        self._kinds = {joint.name: joint.kind for joint in description.joints}
        self.own_joint_names = tuple(self._kinds)
        self.joint_names = (*self.own_joint_names, *DEVIATIONS)
        self.frame_names = tuple(self._frames)
        self.boat = "hull" if "hull" in self._frames else "root"
        self._check()
        self._column = {name: column for column, name in enumerate(self.joint_names)}
        self._gliding = self.columns(name for name in DEVIATIONS if "grip" not in name)
        self._trunk_m = self._upright_m()
        self._grip_direction = dict(zip(SIDES, grip_direction_rad, strict=True))

    def _check(self) -> None:
        joints = (
            "seat",
            "trunk",
            *(f"{s}_{j}" for s in SIDES for j in (*ARM_JOINTS, "oar_phi", "oar_alpha")),
        )
        for kind, names, there in (("frame", _NEEDED_FRAMES, self._frames), ("joint", joints, self._kinds)):
            lacking = [name for name in names if name not in there]
            if lacking:
                raise DataError(
                    f"field simulator: the model has no {kind} {', '.join(lacking)}; it supports 'sculler' and "
                    "models with the same joints and frames"
                )
        other = sorted({kind for kind in self._kinds.values() if kind not in ("hinge", "slide")})
        if other:
            raise DataError(
                f"field simulator: the model has {', '.join(other)} joints; it supports hinges and slides"
            )

    def _upright_m(self) -> float:
        """Distance from the hip to the middle of the shoulder line, m."""
        upright = self.poses(
            np.zeros(len(self.joint_names)), ("seat", *(f"{side}_shoulder" for side in SIDES))
        )
        middle = np.mean([upright[f"{side}_shoulder"][1] for side in SIDES], axis=0)
        return float(np.linalg.norm(middle - upright["seat"][1]))

    def wears(self, frame: str) -> bool:
        """Whether a frame is part of the rower, not of the boat."""
        at: str | None = frame
        while at is not None and at != "seat":
            at = self._frames[at].parent
        return at == "seat"

    def columns(self, names: Iterable[str]) -> list[int]:
        """Columns of the posture of these joints and deviations."""
        return [self._column[name] for name in names]

    def forward_kinematics(self, q: ArrayLike, /) -> Floats:
        """Poses (..., n_frames, 4, 4), root from frame, of postures (..., n_joints + n_deviations)."""
        posture = np.asarray(q, dtype=np.float64)
        found = self.poses(posture, self.frame_names)
        stacked = np.zeros((*posture.shape[:-1], len(self.frame_names), 4, 4))
        for k, name in enumerate(self.frame_names):
            stacked[..., k, :3, :3], stacked[..., k, :3, 3] = found[name]
        stacked[..., 3, 3] = 1.0
        return stacked

    def poses(self, posture: Floats, names: Iterable[str]) -> dict[str, Pose]:
        """Poses of the named frames in root axes, and of the frames between them and the root."""
        found: dict[str, Pose] = {}
        for name in names:
            self._reach(name, posture, found)
        return found

    def _reach(self, name: str, posture: Floats, found: dict[str, Pose]) -> Pose:
        if name in found:
            return found[name]
        frame = self._frames[name]
        if frame.parent is None:
            shape = posture.shape[:-1]
            found[name] = np.broadcast_to(np.eye(3), (*shape, 3, 3)), np.zeros((*shape, 3))
            return found[name]
        pose = placed(self._reach(frame.parent, posture, found), frame.before)
        if frame.joint is not None:
            value = frame.sign * posture[..., self._column[frame.joint]]
            pose = turned(pose, value) if self._kinds[frame.joint] == "hinge" else slid(pose, value)
        pose = placed(pose, frame.after)
        side = name.partition("_")[0]
        if name == f"{side}_shoulder":
            pose = self._glided(pose, side, posture, found)
        elif name == f"{side}_handle":
            pose = self._gripped(pose, side, posture)
        found[name] = pose
        return pose

    def _of(self, posture: Floats, name: str) -> Floats:
        return np.asarray(posture[..., self._column[name]])

    def _glided(self, pose: Pose, side: str, posture: Floats, found: dict[str, Pose]) -> Pose:
        """The shoulder's frame: oriented as on a rigid trunk, with its origin moved by girdle and scapula."""
        if not posture[..., self._gliding].any():
            return pose
        hip, girdle = found["seat"], self.trunk_at(np.float64(1.0), posture, found)
        forward, along, _ = trunk_axes(hip[0], self._of(posture, "trunk"))
        rigid = pose[1] - hip[1] - self._trunk_m * along
        origin = girdle[1] + apply(girdle[0], rigid)
        origin = origin + self._of(posture, f"{side}_protraction")[..., None] * forward
        origin = origin + self._of(posture, f"{side}_elevation")[..., None] * along
        return pose[0], origin

    def trunk_at(self, share: Floats | np.float64, posture: Floats, found: dict[str, Pose]) -> Pose:
        """The spine at a share of the way from hip to shoulder line: rotation relative to a rigid trunk, and position.

        The spine is an arc of the trunk's length. Its chord has the trunk's inclination, and its twist is uniform.
        """
        hip, lean = found["seat"], self._of(posture, "trunk")
        bend, twist = (self._of(posture, name) for name in ("spine_bend", "trunk_twist"))
        _, along, right = trunk_axes(hip[0], lean)
        beyond = rotation_about(right, bend * (share - 0.5)) @ rotation_about(along, twist * share)
        part = bend * share / 2.0
        chord = self._trunk_m * share * np.sinc(part / np.pi)
        _, there, _ = trunk_axes(hip[0], lean + bend * (share - 1.0) / 2.0)
        return beyond, hip[1] + chord[..., None] * there

    def bone(self, frame: str, offset_m: Floats, posture: Floats) -> Pose:
        """The link under a sensor at ``offset_m`` (3,) in a frame's axes; on the trunk this is the spine."""
        found = self.poses(posture, (frame,))
        rotation, origin = found[frame]
        side = frame.partition("_")[0]
        if frame != f"{side}_shoulder" or not posture[..., self._gliding].any():
            return rotation, origin
        neutral = posture.copy()
        neutral[..., self.columns(DEVIATIONS)] = 0.0
        rotation, origin = self.poses(neutral, (frame,))[frame]
        hip = found["seat"]
        _, along, _ = trunk_axes(hip[0], self._of(posture, "trunk"))
        reach = origin + apply(rotation, offset_m) - hip[1]
        height = np.sum(reach * along, axis=-1)
        beyond, spine = self.trunk_at(height / self._trunk_m, posture, found)
        place = spine + apply(beyond, reach - height[..., None] * along)
        rotation = beyond @ rotation
        return rotation, place - apply(rotation, offset_m)

    def _gripped(self, pose: Pose, side: str, posture: Floats) -> Pose:
        """Pose of the handle relative to the hand, with slip along it and tilt, independent of feathering."""
        if not posture[..., self.columns([f"{side}_grip_turn", f"{side}_grip_slip"])].any():
            return pose
        angle = self._of(posture, f"{side}_grip_turn")
        theta = f"{side}_oar_theta"
        feathered = self._of(posture, theta) if theta in self._kinds else np.zeros_like(angle)
        direction = self._grip_direction[side] - feathered
        across = np.stack([np.cos(direction), np.sin(direction), np.zeros_like(direction)], axis=-1)
        slip = self._of(posture, f"{side}_grip_slip")[..., None]
        return pose[0] @ rotation_about(across, angle), pose[1] + slip * pose[0][..., :, 2]


def trunk_axes(seat: Floats, lean: Floats) -> tuple[Floats, Floats, Floats]:
    """Forward, along the trunk and right (..., 3), in root axes, at an inclination (...), positive backwards."""
    up, bow, right = (apply(seat, axis) for axis in (_UP, _BOW, _RIGHT))
    cosine, sine = np.cos(lean)[..., None], np.sin(lean)[..., None]
    return sine * up - cosine * bow, cosine * up + sine * bow, right


def apply(rotation: Floats, vector: Floats) -> Floats:
    """Rotations (..., 3, 3) times vectors (3,) or (..., 3)."""
    return np.asarray(sum(rotation[..., k] * vector[..., k, None] for k in range(3)))


def rotation_about(axis: Floats, angle: Floats) -> Floats:
    """Rodrigues' formula: (..., 3, 3) from unit axes (..., 3) and angles (...)."""
    x, y, z = np.moveaxis(np.broadcast_to(axis, (*np.shape(angle), 3)), -1, 0)
    cosine, sine, versine = np.cos(angle), np.sin(angle), 2.0 * np.sin(angle / 2.0) ** 2
    rotation = np.empty((*np.shape(angle), 3, 3))
    for k, along in enumerate((x, y, z)):
        rotation[..., k, k] = cosine + versine * along**2
    for i, j, one, other, across in ((0, 1, x, y, z), (1, 2, y, z, x), (2, 0, z, x, y)):
        both, turn = versine * one * other, sine * across
        rotation[..., i, j], rotation[..., j, i] = both - turn, both + turn
    return rotation


def rotation_by(vector: Floats) -> Floats:
    """(..., 3, 3) from rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(vector, axis=-1)
    return rotation_about(vector / np.maximum(angle, 1e-300)[..., None], angle)


def placed(pose: Pose, fixed: TransformDescription | None) -> Pose:
    """A pose followed by a constant transform of a description."""
    if fixed is None:
        return pose
    rotation, translation = np.asarray(fixed.rotation), np.asarray(fixed.translation)
    moved = pose[1] + apply(pose[0], translation) if translation.any() else pose[1]
    turned_on = (pose[0].reshape(-1, 3) @ rotation).reshape(pose[0].shape)
    return turned_on, moved


def turned(pose: Pose, angle: Floats) -> Pose:
    """A pose rotated about its own z."""
    x, y, z = (pose[0][..., :, k] for k in range(3))
    cosine, sine = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1), pose[1]


def slid(pose: Pose, way: Floats) -> Pose:
    """A pose moved along its own z."""
    return pose[0], pose[1] + way[..., None] * pose[0][..., :, 2]
