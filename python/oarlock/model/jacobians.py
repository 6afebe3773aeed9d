"""What `Model.frame_jacobian` and `Model.measurement_jacobian` give: exact derivatives, named.

A ball joint's three coordinates count as a small turn e behind the joint: the rotation R becomes R Exp(e), e in
the child's axes, as in CONVENTIONS.md. Lengths are the parameters that move places and turn nothing,
`Model.length_names`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from oarlock.storage.arrays import Floats


class FrameJacobian(NamedTuple):
    """Derivatives of the poses of frames, in root axes.

    Args:
        by_coordinate: (..., n_frames, 6, n_coordinates). Rows 0 to 2: move of the frame's origin, m per rad
            or m. Rows 3 to 5: turn of the frame, a small rotation vector, rad per rad or m.
        by_length: (..., n_frames, 3, n_lengths) move of the frame's origin, m per m. Lengths turn nothing.
    """

    by_coordinate: Floats
    by_length: Floats


class MeasurementJacobian(NamedTuple):
    """Derivatives of predicted readings, rows in the order of `Model.measurement_names`, in their SI units and uT.

    Args:
        by_q: (..., n_measurements, n_coordinates) by coordinates, rad or m.
        by_qd: by their rates, rad/s or m/s.
        by_qdd: by their accelerations, rad/s2 or m/s2.
        by_length: (..., n_measurements, n_lengths) by lengths, m.
    """

    by_q: Floats
    by_qd: Floats
    by_qdd: Floats
    by_length: Floats


def relative_moves(poses: Floats, by_coordinate: Floats) -> Floats:
    """Derivatives (..., K, 3, n) of places in the axes of a frame, which is the first of all.

    Args:
        poses: (..., K + 1, 4, 4) of that frame and the others, in any axes.
        by_coordinate: (..., K + 1, 6, n) of the same in the same axes, as `FrameJacobian.by_coordinate` has it.
    """
    arms = poses[..., 1:, :3, 3] - poses[..., :1, :3, 3]
    turned = np.cross(by_coordinate[..., :1, 3:, :], arms[..., None], axis=-2)
    moves = by_coordinate[..., 1:, :3, :] - by_coordinate[..., :1, :3, :] - turned
    return np.asarray(np.swapaxes(poses[..., :1, :3, :3], -1, -2) @ moves)
