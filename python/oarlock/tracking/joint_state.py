"""One joint in one state estimate (`JointState`): what `belief["elbow"]` returns, live too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.suggest import did_you_mean

AXES = {"rx", "ry", "rz", "x", "y", "z"}


@dataclass(frozen=True)
class JointState:
    """A joint at one time: a number of a hinge or slide, rad or m; (3,) rotation vector of a ball, rad; (6,) if free.

    `velocity` is per s; `std` and `velocity_std` are standard deviations in the same order.
    """

    name: str
    value: float | Floats
    std: float | Floats
    velocity: float | Floats
    velocity_std: float | Floats

    @property
    def angle_rad(self) -> float | Floats:
        """Angle of a hinge, rad."""
        return self.value

    @property
    def angle_deg(self) -> float | Floats:
        """Angle of a hinge, deg."""
        return np.degrees(self.value)

    @property
    def std_rad(self) -> float | Floats:
        """Standard deviation of the angle, rad."""
        return self.std

    @property
    def std_deg(self) -> float | Floats:
        """Standard deviation of the angle, deg."""
        return np.degrees(self.std)


class _Belief(Protocol):
    """What is read of the engine's state estimate."""

    @property
    def mean(self) -> Floats: ...
    @property
    def covariance(self) -> Floats: ...
    @property
    def state_names(self) -> list[str]: ...


def joint_names(belief: _Belief) -> list[str]:
    """Joints that a state estimate has, in the model's order."""
    coordinates = (
        name.removesuffix(".velocity") for name in belief.state_names if name.endswith(".velocity")
    )
    return list(dict.fromkeys(_joint_of(name) for name in coordinates))


def _joint_of(coordinate: str) -> str:
    joint, _, axis = coordinate.rpartition(".")
    return joint if axis in AXES else coordinate


def joint_state(belief: _Belief, name: str) -> JointState:
    """The joint of this name.

    Raises:
        KeyError: no such joint; the text names the nearest one.
    """
    names = joint_names(belief)
    if name not in names:
        raise KeyError(f"no joint '{name}'. {did_you_mean(name, names)}")
    columns = {n: k for k, n in enumerate(belief.state_names)}
    own = [k for coordinate, k in columns.items() if _joint_of(coordinate) == name]
    rates = [columns[f"{belief.state_names[k]}.velocity"] for k in own]
    value, velocity = belief.mean[own], belief.mean[rates]
    std, velocity_std = (np.sqrt(np.diagonal(belief.covariance)[k]) for k in (own, rates))
    if len(own) == 1:
        return JointState(name, *(float(x[0]) for x in (value, std, velocity, velocity_std)))
    return JointState(name, value, std, velocity, velocity_std)
