"""Rotation axes of a model's joints, computed from its poses, for inverse kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from oarlock.model.rotation import quat_from_matrix, rotvec_from_quat

if TYPE_CHECKING:
    from oarlock._core import Model

Floats = NDArray[np.float64]

TURNS = 0.5
"""Threshold, rad: one radian of a coordinate rotates a frame by 1 rad, or not at all."""


class TurningAxes:
    """Rotation of chosen frames by the coordinates of a model.

    The axis of a hinge, and each of the three of a ball joint, is constant in the axes of the frame that it rotates. So
    the axes are computed once, from poses with one coordinate at one radian. `columns` are the coordinates that rotate
    any of the frames.

    Args:
        model: the tree.
        frames: the chosen frames.
    """

    def __init__(self, model: Model, frames: Sequence[str]) -> None:
        names = list(model.frame_names)
        parents = {f["name"]: f["parent"] for f in model.describe()["frames"]}
        n = len(model.coordinate_names)
        turned = model.forward_kinematics(np.vstack([np.zeros((1, n)), np.eye(n)]))[..., :3, :3]
        moving: list[tuple[str, int, Floats]] = []
        for name, parent in parents.items():
            if parent is not None:
                relative = np.swapaxes(turned[:, names.index(parent)], 1, 2) @ turned[:, names.index(name)]
                axes = rotvec_from_quat(quat_from_matrix(relative[0].T @ relative[1:]))
                chosen = np.flatnonzero(np.linalg.norm(axes, axis=1) > TURNS)
                moving += [(name, int(k), axes[k]) for k in chosen]
        self.frames = [names.index(name) for name in frames]
        self._carriers = [names.index(name) for name, _, _ in moving]
        self._axes = np.array([axis for _, _, axis in moving]).reshape(-1, 3)
        self._feels = np.zeros((len(moving), len(frames), n))
        for s, frame in enumerate(frames):
            above = _up_to_root(frame, parents)
            for i, (carrier, k, _) in enumerate(moving):
                self._feels[i, s, k] = carrier in above
        self.columns = np.flatnonzero(self._feels.any(axis=(0, 1)))

    def jacobian(self, rotations: Floats, columns: NDArray[np.intp]) -> Floats:
        """(T, S, 3, k): rotation of each chosen frame in root axes per unit of each of k coordinates.

        For a ball joint the coordinates are those of the error in the child's axes. `rotations` (T, n_frames, 3, 3),
        root from frame.
        """
        in_root = np.einsum("tfij,fj->tif", rotations[:, self._carriers], self._axes)
        chosen = self._feels[:, :, columns]
        turns = in_root.reshape(-1, len(chosen)) @ chosen.reshape(len(chosen), -1)
        return np.swapaxes(turns.reshape(len(rotations), 3, *chosen.shape[1:]), 1, 2)


def _up_to_root(frame: str, parents: dict[str, str | None]) -> set[str]:
    above: set[str] = set()
    at: str | None = frame
    while at is not None:
        above.add(at)
        at = parents[at]
    return above
