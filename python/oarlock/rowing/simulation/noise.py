"""Sensor noise and biases of the simulated experiment in Ruffaldi, Peppoloni and Filippeschi.

"Sensor fusion for complex articulated body tracking applied in rowing", section 4.1: standard deviations
measured on five resting InvenSense MPU9150 units (Table 4), biases and conditions (Table 5).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class ImuNoise:
    """White-noise standard deviations of one inertial unit, the same on its three axes."""

    gyro_std_rad_s: float
    accel_std_m_s2: float
    mag_std_ut: float


@dataclass(frozen=True)
class SimulatedCondition:
    """One column of Table 5: whether the boat surges, and the constant biases on every axis."""

    name: str
    boat_surge: bool
    gyro_bias_rad_s: float
    accel_bias_m_s2: float


# Table 4 heads the gyroscope's column "rad/s2 1e-3"; the figures are rad/s.
TABLE_4_NOISE: Mapping[str, ImuNoise] = MappingProxyType(
    {
        "back": ImuNoise(8.36e-3, 7.16e-3, 1.242),
        "r_upperarm": ImuNoise(11.09e-3, 5.18e-3, 1.167),
        "r_forearm": ImuNoise(6.75e-3, 3.66e-3, 1.028),
        "l_upperarm": ImuNoise(4.35e-3, 4.24e-3, 0.951),
        "l_forearm": ImuNoise(4.46e-3, 1.92e-3, 0.863),
    }
)
"""Standard deviations of the paper's five inertial units (its Table 4), by the name of the unit."""

# Ten times what the authors measured on their units at rest.
TABLE_5_GYRO_BIAS_RAD_S = 0.01
TABLE_5_ACCEL_BIAS_M_S2 = 0.01

CONDITIONS: Mapping[str, SimulatedCondition] = MappingProxyType(
    {
        "S-NB": SimulatedCondition("S-NB", False, 0.0, 0.0),
        "B-NB": SimulatedCondition("B-NB", True, 0.0, 0.0),
        "S-B": SimulatedCondition("S-B", False, TABLE_5_GYRO_BIAS_RAD_S, TABLE_5_ACCEL_BIAS_M_S2),
        "B-B": SimulatedCondition("B-B", True, TABLE_5_GYRO_BIAS_RAD_S, TABLE_5_ACCEL_BIAS_M_S2),
    }
)
"""The four conditions of the paper by name: boat still (S) or surging (B), sensors without (NB) or with (B) biases."""


def condition_named(name: str) -> SimulatedCondition:
    """A column of Table 5.

    Raises:
        ValueError: the table has no such condition.
    """
    if name not in CONDITIONS:
        raise ValueError(f"no condition '{name}'; Table 5 has {', '.join(CONDITIONS)}")
    return CONDITIONS[name]
