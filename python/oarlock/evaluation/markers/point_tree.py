"""Positions of points on a tree of frames, and their derivatives with respect to every coordinate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from oarlock.evaluation.markers.attachments import Attachment
from oarlock.model.coordinates import plus, rotation_columns
from oarlock.model.rotation import quat_from_rotvec, rotvec_between
from oarlock.storage.arrays import Bools, Floats

if TYPE_CHECKING:
    from oarlock._core import Model


class PointTree:
    """Points fixed to frames of a model.

    Coordinates change by small steps: steps of hinges, slides and positions are added; a rotation R becomes R Exp(e)
    with e in the child's axes, so no posture of a ball joint is singular.

    Args:
        model: the tree.
        attachments: the points on it, in this order.
        lengths_m: (n_lengths,) in the order of `model.length_names`; None uses the model's.
    """

    def __init__(
        self, model: Model, attachments: Sequence[Attachment], lengths_m: Floats | None = None
    ) -> None:
        self.model, self.lengths_m = model, lengths_m
        self.rotations = rotation_columns(model.coordinate_names)
        self._carriers = list(dict.fromkeys(a.frame for a in attachments))
        self._carrier = [self._carriers.index(a.frame) for a in attachments]
        self._frames = [model.frame_names.index(a.frame) for a in attachments]
        self._points = np.array([a.point_m for a in attachments])

    @property
    def touched(self) -> Bools:
        """Coordinates that move at least one point, (n_coordinates,)."""
        described = self.model.describe()
        coordinates = {joint.name: joint.coordinates for joint in described.joints}
        frames = {frame.name: frame for frame in described.frames}
        moved: set[str] = set()
        for carrier in self._carriers:
            name: str | None = carrier
            while name is not None:
                moved.update(coordinates.get(frames[name].joint or "", ()))
                name = frames[name].parent
        return np.array([name in moved for name in self.model.coordinate_names], dtype=bool)

    def at(self, q: Floats) -> Floats:
        """Points (T, n, 3) in root axes at coordinates (T, n_coordinates), m."""
        return self._placed(self._poses(q))[1]

    def with_slopes(self, q: Floats) -> tuple[Floats, Floats]:
        """Points (T, n, 3), and their derivatives (T, n, 3, n_coordinates) by small steps of the coordinates."""
        arms, places = self._placed(self._poses(q))
        return places, self._moved(
            self.model.frame_jacobian(q, self._carriers, self.lengths_m).by_coordinate, arms
        )

    def by_length(self, q: Floats) -> Floats:
        """Derivatives (T, n, 3, n_lengths) of the points by the model's lengths."""
        return np.asarray(
            self.model.frame_jacobian(q, self._carriers, self.lengths_m).by_length[:, self._carrier]
        )

    def plus(self, q: Floats, step: Floats) -> Floats:
        """Coordinates (T, n_coordinates) after small steps."""
        return plus(q, step, self.rotations)

    def minus(self, q: Floats, other: Floats) -> Floats:
        """The steps that lead from `other` to `q`, (T, n_coordinates)."""
        step = np.asarray(q - other)
        for columns in self.rotations:
            start, end = quat_from_rotvec(other[:, columns]), quat_from_rotvec(q[:, columns])
            step[:, columns] = rotvec_between(start, end)
        return step

    def _poses(self, q: Floats) -> Floats:
        return np.asarray(self.model.forward_kinematics(q, self.lengths_m))

    def _placed(self, poses: Floats) -> tuple[Floats, Floats]:
        """Positions of the points relative to their frames' origins and to the root, in root axes."""
        carriers = poses[:, self._frames]
        arms = np.einsum("tnij,nj->tni", carriers[..., :3, :3], self._points)
        return arms, np.asarray(arms + carriers[..., :3, 3])

    def _moved(self, by_coordinate: Floats, arms: Floats) -> Floats:
        of_frames = by_coordinate[:, self._carrier]
        return np.asarray(of_frames[:, :, :3] + np.cross(of_frames[:, :, 3:], arms[..., None], axis=2))
