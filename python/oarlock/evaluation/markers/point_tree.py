"""Positions of points on a tree of frames, and their derivatives with respect to every coordinate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.evaluation.markers.attachments import Attachment
from oarlock.evaluation.markers.trajectories import Bools
from oarlock.model.coordinates import plus, rotation_columns
from oarlock.model.rotation import quat_from_rotvec, rotvec_between
from oarlock.storage.array_gate import FloatArray

if TYPE_CHECKING:
    from oarlock._core import Model


@dataclass(frozen=True, eq=False)
class _Mover:
    """A frame with a joint: where the joint acts in its parent, and which points it carries."""

    frame: int
    parent: int
    rotation: FloatArray
    translation: FloatArray
    kind: str
    sign: float
    columns: tuple[int, ...]
    points: Any


class PointTree:
    """Points fixed to frames of a model.

    Coordinates change by small steps: hinges, slides and places add, a rotation R becomes R Exp(e) with e in the
    child's axes, so no posture of a ball is singular. Derivatives come from the joints' axes in the poses that the
    model's forward kinematics gives, not from differences.

    Args:
        model: the tree.
        attachments: points on it, in this order.
    """

    def __init__(self, model: Model, attachments: Sequence[Attachment]) -> None:
        self.model = model
        self.rotations = rotation_columns(model.coordinate_names)
        self._frames = [model.frame_names.index(a.frame) for a in attachments]
        self._points = np.array([a.point_m for a in attachments])
        self._movers = _movers(model, self._frames)

    @property
    def touched(self) -> Bools:
        """Which coordinates move any point, (n_coordinates,)."""
        moved = np.zeros(len(self.model.coordinate_names), dtype=bool)
        for mover in self._movers:
            moved[list(mover.columns)] = True
        return moved

    def at(self, q: FloatArray) -> FloatArray:
        """Points (T, n, 3) in root axes at coordinates (T, n_coordinates), m."""
        return self._placed(self.model.forward_kinematics(q))

    def with_slopes(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (T, n, 3), and their derivatives (T, n, 3, n_coordinates) by small steps of the coordinates."""
        poses = self.model.forward_kinematics(q)
        places = self._placed(poses)
        slopes = np.zeros((*places.shape, q.shape[1]))
        for mover in self._movers:
            axes = poses[:, mover.parent, :3, :3] @ mover.rotation
            origin = poses[:, mover.parent, :3, 3] + poses[:, mover.parent, :3, :3] @ mover.translation
            self._add(slopes, mover, axes, origin, (poses[:, mover.frame], places))
        return places, slopes

    def plus(self, q: FloatArray, step: FloatArray) -> FloatArray:
        """Coordinates (T, n_coordinates) after small steps."""
        return plus(q, step, self.rotations)

    def minus(self, q: FloatArray, other: FloatArray) -> FloatArray:
        """The steps that lead from `other` to `q`, (T, n_coordinates)."""
        step = np.asarray(q - other)
        for columns in self.rotations:
            start, end = quat_from_rotvec(other[:, columns]), quat_from_rotvec(q[:, columns])
            step[:, columns] = rotvec_between(start, end)
        return step

    def _placed(self, poses: FloatArray) -> FloatArray:
        carriers = poses[:, self._frames]
        return np.asarray(
            np.einsum("tnij,nj->tni", carriers[..., :3, :3], self._points) + carriers[..., :3, 3]
        )

    @staticmethod
    def _add(
        slopes: FloatArray,
        mover: _Mover,
        axes: FloatArray,
        origin: FloatArray,
        child_and_places: tuple[FloatArray, FloatArray],
    ) -> None:
        child, places = child_and_places
        columns, points = list(mover.columns), mover.points
        if mover.kind == "slide":
            slopes[..., columns[0]][:, points] += mover.sign * axes[:, None, :, 2]
            return
        if mover.kind == "free":
            for k in range(3):
                slopes[..., columns[k]][:, points] += axes[:, None, :, k]
            columns = columns[3:]
        if mover.kind == "hinge":
            arm = places[:, points] - origin[:, None]
            slopes[..., columns[0]][:, points] += mover.sign * np.cross(axes[:, None, :, 2], arm)
            return
        arm = places[:, points] - child[:, None, :3, 3]
        for k in range(3):
            slopes[..., columns[k]][:, points] += np.cross(child[:, None, :3, k], arm)


def _movers(model: Model, carriers: Sequence[int]) -> tuple[_Mover, ...]:
    described = model.describe()
    joints = {joint["name"]: joint for joint in described["joints"]}
    frames = described["frames"]
    index = {frame["name"]: k for k, frame in enumerate(frames)}
    above = [_path(frames, index, carrier) for carrier in carriers]
    found = []
    for k, frame in enumerate(frames):
        points = np.array([p for p, path in enumerate(above) if k in path], dtype=np.intp)
        joint = joints.get(frame["joint"])
        if joint is None or joint["kind"] == "fixed" or not len(points):
            continue
        before = frame["before"] or {"rotation": np.eye(3), "translation": np.zeros(3)}
        found.append(
            _Mover(
                frame=k,
                parent=index[frame["parent"]],
                rotation=np.asarray(before["rotation"], dtype=np.float64),
                translation=np.asarray(before["translation"], dtype=np.float64),
                kind=joint["kind"],
                sign=float(frame["sign"]),
                columns=tuple(model.coordinate_names.index(name) for name in joint["coordinates"]),
                points=points,
            )
        )
    return tuple(found)


def _path(frames: Sequence[Any], index: dict[str, int], carrier: int) -> set[int]:
    found: set[int] = set()
    here: int | None = carrier
    while here is not None:
        found.add(here)
        parent = frames[here]["parent"]
        here = None if parent is None else index[parent]
    return found
