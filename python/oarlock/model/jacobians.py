"""What `Model.frame_jacobian` and `Model.measurement_jacobian` give: exact derivatives, named.

A ball joint's three coordinates count as a small turn e behind the joint: the rotation R becomes R Exp(e), e in
the child's axes, as in CONVENTIONS.md. Lengths are the parameters with unit m, in the order of `Model.length_names`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class FrameJacobian(NamedTuple):
    """Derivatives of the poses of frames, in root axes.

    Args:
        by_coordinate: (..., n_frames, 6, n_coordinates). Rows 0 to 2: move of the frame's origin, m per rad
            or m. Rows 3 to 5: turn of the frame, a small rotation vector, rad per rad or m.
        by_length: (..., n_frames, 3, n_lengths) move of the frame's origin, m per m. Lengths turn nothing.
    """

    by_coordinate: NDArray[np.float64]
    by_length: NDArray[np.float64]


class MeasurementJacobian(NamedTuple):
    """Derivatives of predicted readings, rows in the order of `Model.measurement_names`, in their SI units and uT.

    Args:
        by_q: (..., n_measurements, n_coordinates) by coordinates, rad or m.
        by_qd: by their rates, rad/s or m/s.
        by_qdd: by their accelerations, rad/s2 or m/s2.
        by_length: (..., n_measurements, n_lengths) by lengths, m.
    """

    by_q: NDArray[np.float64]
    by_qd: NDArray[np.float64]
    by_qdd: NDArray[np.float64]
    by_length: NDArray[np.float64]
