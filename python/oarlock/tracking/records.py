"""What a track keeps beside its joints: slow states, what became of the readings, full beliefs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FIELD = ("missing", "undisturbed", "norm", "dip", "innovation")
"""What a magnetometer's reading was: not there, the undisturbed field, or disturbed, by the first test it failed."""
DISTURBED = FIELD[2:]
FAULT = ("none", "clipped", "stuck")
"""What was wrong with a sensor's readings and kept from the filter: an axis at the end of its range, or a value that
repeats itself to the bit."""


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
    `field` says what a magnetometer's reading was, as an index into `FIELD`; `fault` what was wrong with the sensor's
    readings, as an index into `FAULT`.
    """

    sensor_names: tuple[str, ...]
    nis: Floats
    used: NDArray[np.int64]
    rejected: NDArray[np.int64]
    missing: NDArray[np.int64]
    inertial_nis: Floats
    inertial_used: NDArray[np.int64]
    field: NDArray[np.int64]
    fault: NDArray[np.int64]

    def disturbed(self, test: str | None = None) -> Bools:
        """Which magnetometer samples were not used, (T, S): those that failed `norm`, `dip` or `innovation`, or any.

        Raises:
            DataError: no such test.
        """
        if test is None:
            return np.asarray(self.field >= FIELD.index(DISTURBED[0]))
        if test not in DISTURBED:
            raise DataError(f"disturbed: no test '{test}'. {did_you_mean(test, DISTURBED)}")
        return np.asarray(self.field == FIELD.index(test))

    def faulty(self, fault: str | None = None) -> Bools:
        """Which samples held readings that were no measurements and were not used, (T, S): `clipped`, `stuck`, or any.

        Raises:
            DataError: no such fault.
        """
        if fault is None:
            return np.asarray(self.fault > 0)
        if fault not in FAULT[1:]:
            raise DataError(f"faulty: no fault '{fault}'. {did_you_mean(fault, FAULT[1:])}")
        return np.asarray(self.fault == FAULT.index(fault))


@dataclass(frozen=True)
class Beliefs:
    """Full beliefs every few seconds: (B,) s, (B, n), (B, n, n); states in SI and rad."""

    time_s: Floats
    mean: Floats
    covariance: Floats
    state_names: tuple[str, ...]
