"""The box of three angles that contains the range of a ball joint. `opensim_body` uses it for sliders."""

from __future__ import annotations

import numpy as np

from oarlock.model.description import ConeDescription
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec, quat_product
from oarlock.storage.arrays import Floats

_SHARES = np.linspace(0.0, 1.0, 5)
_AROUND = np.radians(np.arange(0.0, 360.0, 10.0))
_TWISTS = 9


def angle_box(cone: ConeDescription, rest: Floats) -> Floats:
    """Least and greatest X, Y, Z angles (3, 2), rad, in the intrinsic sequence XYZ, of postures in the cone.

    Args:
        cone: range of swing and twist, from rest.
        rest: (3,) rotation vector.
    """
    axis = "xyz".index(cone.axis)
    others = [k for k in range(3) if k != axis]
    share, around, twist = (
        part.ravel()
        for part in np.meshgrid(_SHARES, _AROUND, np.linspace(*cone.twist, _TWISTS), indexing="ij")
    )
    swung, twisted = np.zeros((2, len(twist), 3))
    radius = 1.0 / np.hypot(np.cos(around) / cone.swing[0], np.sin(around) / cone.swing[1])
    swung[:, others[0]] = share * radius * np.cos(around)
    swung[:, others[1]] = share * radius * np.sin(around)
    twisted[:, axis] = twist
    from_rest = quat_product(quat_from_rotvec(swung), quat_from_rotvec(twisted))
    matrix = matrix_from_quat(quat_product(quat_from_rotvec(np.asarray(rest)[None]), from_rest))
    angles = (
        np.arctan2(-matrix[:, 1, 2], matrix[:, 2, 2]),
        np.arcsin(np.clip(matrix[:, 0, 2], -1.0, 1.0)),
        np.arctan2(-matrix[:, 0, 1], matrix[:, 0, 0]),
    )
    return np.array([[angle.min(), angle.max()] for angle in angles])
