"""Parts of a track other than joints: slow states (biases, field azimuth), use of each sensor's readings, beliefs."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from oarlock.storage.arrays import Bools, Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.storage.short_repr import ShortRepr
from oarlock.storage.suggest import did_you_mean

FIELD = ("missing", "undisturbed", "norm", "dip", "innovation")
"""Result of the tests of a magnetometer's reading: missing, undisturbed, or the first test that it failed."""
DISTURBED = FIELD[2:]
FAULT = ("none", "clipped", "stuck")
"""Fault for which a sensor's readings were not used: an axis at the end of its range (clipped), or a value that is
repeated exactly (stuck)."""


@dataclass(frozen=True, repr=False)
class SlowSeries(ShortRepr):
    """A slow state over time: a bias, an acceleration of the base or the field's azimuth. Value and std, (T,) each."""

    value: Floats
    std: Floats
    unit: str


@dataclass(frozen=True, repr=False)
class SensorInfo(ShortRepr):
    """Readings used, rejected and missing in each update, by sensor and closure: (T, S) each.

    `nis` is NaN where no reading was used. `inertial_nis` (T,) is the NIS of all inertial readings of a sample
    together, `inertial_used` (T,) their number. `field` is the result of the magnetometer tests as an index into
    `FIELD`; `fault` is the sensor fault as an index into `FAULT`.
    """

    sensor_names: tuple[str, ...]
    nis: Floats
    used: Ints
    rejected: Ints
    missing: Ints
    inertial_nis: Floats
    inertial_used: Ints
    field: Ints
    fault: Ints

    def of_rows(self, rows: Bools) -> SensorInfo:
        """The same for some of the rows."""
        arrays = {
            one.name: getattr(self, one.name)[rows] for one in fields(self) if one.name != "sensor_names"
        }
        return replace(self, **arrays)

    def disturbed(self, test: str | None = None) -> Bools:
        """True where a magnetometer reading was rejected, (T, S): by the test `norm`, `dip` or `innovation`, or by any.

        Raises:
            DataError: no such test.
        """
        if test is None:
            return np.asarray(self.field >= FIELD.index(DISTURBED[0]))
        if test not in DISTURBED:
            raise DataError(f"disturbed: no test '{test}'. {did_you_mean(test, DISTURBED)}")
        return np.asarray(self.field == FIELD.index(test))

    def faulty(self, fault: str | None = None) -> Bools:
        """True where readings were faulty and not used, (T, S): those with the fault `clipped` or `stuck`, or any.

        Raises:
            DataError: no such fault.
        """
        if fault is None:
            return np.asarray(self.fault > 0)
        if fault not in FAULT[1:]:
            raise DataError(f"faulty: no fault '{fault}'. {did_you_mean(fault, FAULT[1:])}")
        return np.asarray(self.fault == FAULT.index(fault))


@dataclass(frozen=True, repr=False)
class Beliefs(ShortRepr):
    """State estimates every few seconds: times (B,) s, means (B, n), covariances (B, n, n); in SI and rad."""

    time_s: Floats
    mean: Floats
    covariance: Floats
    state_names: tuple[str, ...]

    def between(self, start_s: float, end_s: float) -> Beliefs:
        """Those of a time, both ends included."""
        rows = (self.time_s >= start_s) & (self.time_s <= end_s)
        return Beliefs(self.time_s[rows], self.mean[rows], self.covariance[rows], self.state_names)
