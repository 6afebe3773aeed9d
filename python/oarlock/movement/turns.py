"""How the angles of a track follow small rotations of the segments on both sides. For the uncertainty of ranges.

An error of a segment's axes, such as that of a mount or of a heading, is a small rotation e. The rotation R of a joint,
parent from child, becomes Exp(e_parent) R Exp(e_child), and an angle changes by parent . e_parent + child . e_child.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oarlock import Track
from oarlock.model.coordinates import joint_columns, with_untold_at_zero
from oarlock.model.description import JointDescription, ModelDescription
from oarlock.storage.arrays import Floats
from oarlock.tracking.places import model_of, poses_of

MOST_ROWS = 4096
"""Rows whose derivatives are computed at once: those of all coordinates take much memory."""
DAMPING = 0.05
"""Of the least squares: rotations that joints follow by less than this share of their own hardly turn them."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What the errors of an angle depend on.

    Args:
        turns: (T, 6) change of the angle by a small rotation of the upper (columns 0 to 2) and of the lower segment,
            each about its own axes, deg/deg; NaN where unknown.
        posture_rad: (T, m) the posture: how far two samples are apart is how far joints moved, and how far the free
            segment tilted.
        soft: whether units of the upper and of the lower segment turn with the skin.
    """

    turns: Floats
    posture_rad: Floats
    soft: tuple[bool, bool] = (True, True)


class SegmentTurns:
    """Derivatives of the angles of a track by rotations of the two segments with units between which a joint lies.

    Several joints between both segments follow a rotation together, by damped least squares: an elbow of two hinges.

    Raises:
        DataError: the track has no model.
    """

    def __init__(self, track: Track) -> None:
        self._model = model_of(track, "movement_angles")
        self._description = self._model.describe()
        self._poses = poses_of(track)
        self._q = with_untold_at_zero(track.q)
        self._columns = joint_columns(track.coordinate_names)
        self._found: dict[tuple[str, str], tuple[Floats, Floats]] = {}

    @property
    def joints(self) -> tuple[JointDescription, ...]:
        """The joints of the model."""
        return self._description.joints

    @property
    def up(self) -> tuple[float, ...]:
        """The vertical in the root's axes."""
        return tuple(self._description.world.up)

    def segments(self, joint: str) -> tuple[str, str]:
        """The two segments with units between which a joint lies."""
        return neighbours(self._description, joint)

    def segments_of_units(self, units: Sequence[str]) -> set[str]:
        """The segments that these units are on."""
        return {unit.frame for unit in self._description.inertial_units if unit.name in units}

    @cached_property
    def posture_rad(self) -> Floats:
        """(T, m) joints that turn, rad, and the vertical in the axes of each free segment: a heading is no posture."""
        columns = [np.zeros((len(self._q), 0))]
        for joint in self.joints:
            own = self._q[:, list(self._columns.get(joint.name, ()))]
            if joint.kind in ("hinge", "ball"):
                columns.append(own)
            elif joint.kind == "free":
                segment = next(f.name for f in self._description.frames if f.joint == joint.name)
                turned = self._poses[:, self._model.frame_names.index(segment), :3, :3]
                columns.append(np.einsum("tij,i->tj", turned, np.asarray(self.up)))
        return np.concatenate(columns, axis=1)

    def of(self, joint: str, weights: Floats | None = None) -> Sensitivity:
        """What the errors of an angle of a joint depend on.

        Args:
            joint: hinge, ball or free joint.
            weights: (T, 3) change of the angle by a small rotation behind the joint, in the child's axes; None for a
                hinge.
        """
        upper, lower = self.segments(joint)
        columns = self._between(upper, lower)
        by_coordinate, turned = self._pair(upper, lower, columns)
        rows = by_coordinate[:, [columns.index(column) for column in self._turning(joint)]]
        by_lower = rows[:, 0] if weights is None else np.einsum("tk,tkj->tj", weights, rows)
        by_upper = np.einsum("tij,tj->ti", turned, by_lower)
        # A segment without units, such as the base of a robot, counts like the other one.
        rigid = {unit.frame: unit.mount.rigid for unit in self._description.inertial_units}
        soft = (
            not rigid.get(upper, rigid.get(lower, False)),
            not rigid.get(lower, rigid.get(upper, False)),
        )
        return Sensitivity(np.concatenate([by_upper, by_lower], axis=1), self.posture_rad, soft)

    def _turning(self, joint: str) -> tuple[int, ...]:
        """Columns of a joint's rotation."""
        return self._columns[joint][-3:]

    def _between(self, upper: str, lower: str) -> list[int]:
        """Columns of the joints between two segments."""
        frames = {frame.name: frame for frame in self._description.frames}
        turning = {joint.name for joint in self.joints if joint.kind in ("hinge", "ball", "free")}
        found: list[int] = []
        frame = frames[lower]
        while frame.name != upper and frame.parent is not None:
            if frame.joint in turning:
                found += [column for column in self._turning(frame.joint) if column not in found]
            frame = frames[frame.parent]
        return found

    def _pair(self, upper: str, lower: str, columns: list[int]) -> tuple[Floats, Floats]:
        """Change of coordinates by a rotation of the lower segment (T, n, 3), and upper from lower (T, 3, 3)."""
        if (upper, lower) not in self._found:
            names = self._model.frame_names
            above, below = (self._poses[:, names.index(name), :3, :3] for name in (upper, lower))
            known = np.isfinite(self._q).all(axis=1) & np.isfinite(self._poses).all(axis=(1, 2, 3))
            changes = np.full((len(self._q), len(columns), 3), np.nan)
            for rows in np.array_split(np.flatnonzero(known), 1 + known.sum() // MOST_ROWS):
                both = self._model.frame_jacobian(self._q[rows], [upper, lower]).by_coordinate[
                    :, :, 3:, columns
                ]
                moves = np.swapaxes(below[rows], 1, 2) @ (both[:, 1] - both[:, 0])
                across = np.swapaxes(moves, 1, 2)
                normal = across @ moves + DAMPING**2 * np.eye(len(columns))
                changes[rows] = np.linalg.solve(normal, across)
            self._found[upper, lower] = changes, np.swapaxes(above, 1, 2) @ below
        return self._found[upper, lower]


def neighbours(description: ModelDescription, joint: str) -> tuple[str, str]:
    """The nearest segments with inertial units above and below a joint; the root, or the joint's own, if none is."""
    worn = {unit.frame for unit in description.inertial_units}
    parents = {frame.name: frame.parent for frame in description.frames}
    moved = next(frame.name for frame in description.frames if frame.joint == joint)
    upper = parents[moved]
    while upper is not None and upper not in worn and parents[upper] is not None:
        upper = parents[upper]
    layer = [moved]
    while layer:
        found = next((name for name in layer if name in worn), None)
        if found is not None:
            return upper or moved, found
        layer = [name for name, parent in parents.items() if parent in layer]
    return upper or moved, moved
