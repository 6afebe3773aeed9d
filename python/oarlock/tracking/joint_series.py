"""One joint of a track over time: hinge or slide, ball, free."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from oarlock.model.angle_sequence import angle_stds, angles_from_quat, checked_sequence, near_singular
from oarlock.model.rotation import continuous_quat, matrix_from_quat, quat_from_rotvec

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class JointSeries:
    """A hinge (rad) or slide (m) over time, (T,) each, rates per s and per s2; NaN where there is none."""

    name: str
    unit: str
    value: Floats
    velocity: Floats
    acceleration: Floats
    std: Floats
    velocity_std: Floats
    acceleration_std: Floats
    observed: Bools

    def __getattr__(self, name: str) -> Floats:
        """`angle_rad`, `velocity_rad_s`, `std_rad` of a hinge; `position_m`, `velocity_m_s`, `std_m` of a slide."""
        unit = self.__dict__.get("unit", "")
        names = {
            ("angle_rad" if unit == "rad" else "position_m"): "value",
            f"std_{unit}": "std",
            f"velocity_{unit}_s": "velocity",
            f"velocity_std_{unit}_s": "velocity_std",
            f"acceleration_{unit}_s2": "acceleration",
            f"acceleration_std_{unit}_s2": "acceleration_std",
        }
        if name not in names:
            kind = "hinge" if unit == "rad" else "slide"
            raise AttributeError(f"a {kind} has no '{name}'; it has {', '.join(names)}, observed")
        values: Floats = self.__dict__[names[name]]
        return values


@dataclass(frozen=True)
class BallSeries:
    """A ball joint over time: the rotation of the child against the parent, NaN where there is none.

    Args:
        name: the joint's.
        angle_sequence: the model's named angles, such as "YXY"; see `angles_rad`.
        rotvec_rad: (T, 3) rotation vector of parent-from-child, R = Exp(r).
        velocity_rad_s: (T, 3) angular velocity of the child against the parent, in the child's axes.
        acceleration_rad_s2: (T, 3) its derivative.
        std_rad: (T, 3) standard deviation of the error e in the child's axes, R_true = R Exp(e).
        velocity_std_rad_s: (T, 3).
        acceleration_std_rad_s2: (T, 3).
        observed: (T,) whether the sensors pin all three axes down.
    """

    name: str
    angle_sequence: str
    rotvec_rad: Floats
    velocity_rad_s: Floats
    acceleration_rad_s2: Floats
    std_rad: Floats
    velocity_std_rad_s: Floats
    acceleration_std_rad_s2: Floats
    observed: Bools

    @property
    def unit(self) -> str:
        """Of the joint: "rad"."""
        return "rad"

    @cached_property
    def quat_wxyz(self) -> Floats:
        """(T, 4) unit quaternions of parent-from-child, signs continuous over time."""
        return continuous_quat(quat_from_rotvec(self.rotvec_rad))

    @property
    def matrix(self) -> Floats:
        """(T, 3, 3) rotation matrices, parent-from-child."""
        return matrix_from_quat(self.quat_wxyz)

    def angles_rad(self, sequence: str | None = None) -> Floats:
        """The three named angles (T, 3), rad, continuous over time.

        Args:
            sequence: intrinsic: "YXY" is R = Ry(a) Rx(b) Ry(c); None is the model's own. See
                `oarlock.model.angle_sequence` for how a triple is chosen.

        Raises:
            DataError: no sequence of three axes.
        """
        return angles_from_quat(self.quat_wxyz, self._sequence(sequence))

    def angles_std_rad(self, sequence: str | None = None) -> Floats:
        """Standard deviations (T, 3) of the named angles, rad, to first order from `std_rad`.

        The errors about the child's axes are taken as independent: a track keeps no correlations. Towards a pole the
        first and the last grow without bound.

        Raises:
            DataError: no sequence of three axes.
        """
        return angle_stds(self.angles_rad(sequence), self._sequence(sequence), self.std_rad)

    def near_singular(self, sequence: str | None = None) -> Bools:
        """Where the middle angle is within 15 deg of a pole, (T,): there read the rotation, not its angles.

        Raises:
            DataError: no sequence of three axes.
        """
        return near_singular(self.quat_wxyz, self._sequence(sequence))

    def _sequence(self, sequence: str | None) -> str:
        return checked_sequence(self.angle_sequence if sequence is None else sequence, f'joint "{self.name}"')


@dataclass(frozen=True)
class FreeSeries(BallSeries):
    """A free joint over time: a position, and a rotation with all the names of a ball's.

    Args:
        position_m: (T, 3) of the child's origin in the parent's joint axes.
        velocity_m_s: (T, 3) its derivative, in the same axes; and so on.
        position_observed: (T,) whether the sensors pin the position down; `observed` is of the rotation.
    """

    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    std_m: Floats
    velocity_std_m_s: Floats
    acceleration_std_m_s2: Floats
    position_observed: Bools

    @property
    def unit(self) -> str:
        """Of position and rotation: "m, rad"."""
        return "m, rad"
