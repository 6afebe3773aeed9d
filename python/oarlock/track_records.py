"""What a track keeps beside its joints: slow states, what became of the readings, full beliefs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SlowSeries:
    """A bias, an acceleration of the base or the field's azimuth over time, (T,) each."""

    value: Floats
    std: Floats
    unit: str


@dataclass(frozen=True)
class SensorInfo:
    """What each update did with each sensor and closure: (T, S) each. NIS is NaN where nothing was used.

    `inertial_nis` (T,) is that of all inertial readings of a sample together, `inertial_used` (T,) their number.
    """

    sensor_names: tuple[str, ...]
    nis: Floats
    used: NDArray[np.int64]
    rejected: NDArray[np.int64]
    missing: NDArray[np.int64]
    inertial_nis: Floats
    inertial_used: NDArray[np.int64]


@dataclass(frozen=True)
class Beliefs:
    """Full beliefs every few seconds: (B,) s, (B, n), (B, n, n); states in SI and rad."""

    time_s: Floats
    mean: Floats
    covariance: Floats
    state_names: tuple[str, ...]
