"""One joint of a track over time: what `track["name"]` returns for hinges, slides, balls and free joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from oarlock.model.angle_sequence import angle_stds, angles_from_quat, checked_sequence, near_singular
from oarlock.model.rotation import continuous_quat, matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.short_repr import ShortRepr
from oarlock.storage.suggest import did_you_mean


@dataclass(frozen=True, repr=False)
class JointSeries(ShortRepr):
    """A hinge or a slide over time: values, rates per s and per s2, (T,) each; NaN where not estimated.

    `HingeSeries` and `SlideSeries` have the same arrays under names with their unit.
    """

    name: str
    unit: str
    value: Floats
    velocity: Floats
    acceleration: Floats
    std: Floats
    velocity_std: Floats
    acceleration_std: Floats
    observed: Bools

    if not TYPE_CHECKING:  # the type checker would no longer find misspelt names

        def __getattr__(self, name: str) -> object:
            public = [known for known in dir(type(self)) if not known.startswith("_")]
            kind = "hinge" if "angle_rad" in public else "slide"
            raise AttributeError(f"a {kind} has no '{name}'. {did_you_mean(name, public)}")


@dataclass(frozen=True, repr=False)
class HingeSeries(JointSeries):
    """A hinge over time, (T,) each."""

    @property
    def angle_rad(self) -> Floats:
        """Angle, rad."""
        return self.value

    @property
    def angle_deg(self) -> Floats:
        """Angle, deg."""
        return np.degrees(self.value)

    @property
    def std_rad(self) -> Floats:
        """Standard deviation of the angle, rad."""
        return self.std

    @property
    def std_deg(self) -> Floats:
        """Standard deviation of the angle, deg."""
        return np.degrees(self.std)

    @property
    def velocity_rad_s(self) -> Floats:
        """Rate of the angle, rad/s."""
        return self.velocity

    @property
    def velocity_deg_s(self) -> Floats:
        """Rate of the angle, deg/s."""
        return np.degrees(self.velocity)

    @property
    def velocity_std_rad_s(self) -> Floats:
        """Standard deviation of the rate, rad/s."""
        return self.velocity_std

    @property
    def acceleration_rad_s2(self) -> Floats:
        """Second derivative of the angle, rad/s2."""
        return self.acceleration

    @property
    def acceleration_std_rad_s2(self) -> Floats:
        """Standard deviation of the second derivative, rad/s2."""
        return self.acceleration_std


@dataclass(frozen=True, repr=False)
class SlideSeries(JointSeries):
    """A slide over time, (T,) each."""

    @property
    def position_m(self) -> Floats:
        """Position, m."""
        return self.value

    @property
    def position_cm(self) -> Floats:
        """Position, cm."""
        return 100.0 * self.value

    @property
    def std_m(self) -> Floats:
        """Standard deviation of the position, m."""
        return self.std

    @property
    def velocity_m_s(self) -> Floats:
        """Velocity, m/s."""
        return self.velocity

    @property
    def velocity_std_m_s(self) -> Floats:
        """Standard deviation of the velocity, m/s."""
        return self.velocity_std

    @property
    def acceleration_m_s2(self) -> Floats:
        """Acceleration, m/s2."""
        return self.acceleration

    @property
    def acceleration_std_m_s2(self) -> Floats:
        """Standard deviation of the acceleration, m/s2."""
        return self.acceleration_std


@dataclass(frozen=True, repr=False)
class BallSeries(ShortRepr):
    """A ball joint over time: the rotation of the child relative to the parent, NaN where not estimated.

    Args:
        name: name of the joint.
        angle_sequence: the model's named angles, such as "YXY"; see `angles_rad`.
        rotvec_rad: (T, 3) rotation vector of parent-from-child, R = Exp(r).
        velocity_rad_s: (T, 3) angular velocity of the child relative to the parent, in the child's axes.
        acceleration_rad_s2: (T, 3) its derivative.
        std_rad: (T, 3) standard deviation of the error e in the child's axes, R_true = R Exp(e).
        velocity_std_rad_s: (T, 3) standard deviation of the velocity.
        acceleration_std_rad_s2: (T, 3) standard deviation of the acceleration.
        observed: (T,) true where the sensors determine the rotation about all three axes.
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
        """Unit of the joint: "rad"."""
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
            sequence: intrinsic axes, such as "YXY" for R = Ry(a) Rx(b) Ry(c); None is the model's own.
                `oarlock.model.angle_sequence` describes which of the equivalent triples is returned.

        Raises:
            DataError: no sequence of three axes.
        """
        return angles_from_quat(self.quat_wxyz, self._sequence(sequence))

    def angles_deg(self, sequence: str | None = None) -> Floats:
        """As `angles_rad`, deg."""
        return np.degrees(self.angles_rad(sequence))

    def angles_std_rad(self, sequence: str | None = None) -> Floats:
        """Standard deviations (T, 3) of the named angles, rad, to first order from `std_rad`.

        The errors about the child's axes are assumed independent, because a track stores no correlations. Near a pole
        the standard deviations of the first and the last angle grow without bound.

        Raises:
            DataError: no sequence of three axes.
        """
        return angle_stds(self.angles_rad(sequence), self._sequence(sequence), self.std_rad)

    def near_singular(self, sequence: str | None = None) -> Bools:
        """True where the middle angle is within 15 deg of a pole, (T,). Use the rotation there, not its angles.

        Raises:
            DataError: no sequence of three axes.
        """
        return near_singular(self.quat_wxyz, self._sequence(sequence))

    def _sequence(self, sequence: str | None) -> str:
        return checked_sequence(self.angle_sequence if sequence is None else sequence, f'joint "{self.name}"')


@dataclass(frozen=True, repr=False)
class FreeSeries(BallSeries):
    """A free joint over time: a position, and a rotation with the same fields as `BallSeries`.

    Args:
        position_m: (T, 3) position of the child's origin in the parent's joint axes.
        velocity_m_s: (T, 3) its derivative in the same axes. The other fields follow the same pattern.
        position_observed: (T,) true where the sensors determine the position; `observed` refers to the rotation.
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
        """Units of position and rotation: "m, rad"."""
        return "m, rad"


Joint: TypeAlias = HingeSeries | SlideSeries | BallSeries
"""What a track has for a joint; a `FreeSeries` is a `BallSeries` too."""
