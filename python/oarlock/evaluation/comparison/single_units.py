"""Readings of single inertial units, resampled to a regular grid and split at gaps, for orientation filters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from oarlock.model.rotation import continuous_quat
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats

BRIDGED_S = 0.1
"""A longer stretch without gyroscope or accelerometer is a gap, after which the filter restarts, s."""


@dataclass(frozen=True, eq=False)
class UnitSegment:
    """Readings of one unit without a gap, T >= 2 evenly spaced instants.

    Args:
        time_s: (T,) s.
        step_s: between instants, s.
        gyro_rad_s: (T, 3) mean rate over the step that ends at each instant.
        accel_m_s2: (T, 3) specific force.
        mag_ut: (T, 3) uT; NaN where missing, but not in the first row.
        gyro_std_rad_s: noise of the gyroscope in the model.
    """

    time_s: Floats
    step_s: float
    gyro_rad_s: Floats
    accel_m_s2: Floats
    mag_ut: Floats
    gyro_std_rad_s: float


OrientationFilter = Callable[[UnitSegment, float], Floats]
"""Filter function: stretch and dip of the field, rad -> (T, 4) quat_wxyz, north-west-up from sensor."""


def stretches(stream: ImuStream, gyro_std_rad_s: float) -> Iterator[UnitSegment]:
    """The stretches of a stream that has all three quantities; short gaps are interpolated linearly."""
    gyro, accel, mag = stream.gyro_rad_s, stream.accel_m_s2, stream.mag_ut
    assert gyro is not None and accel is not None and mag is not None
    whole = np.flatnonzero(np.isfinite(gyro).all(axis=1) & np.isfinite(accel).all(axis=1))
    seen = np.flatnonzero(np.isfinite(mag).all(axis=1))
    if len(whole) < 2 or not len(seen):
        return
    step_s = 1.0 / stream.rate_hz
    time_s = stream.time_s[whole]
    gaps = np.flatnonzero(np.diff(time_s) > max(BRIDGED_S, 1.5 * step_s)) + 1
    for begin, end in pairwise([0, *gaps, len(whole)]):
        first, last = time_s[begin], time_s[end - 1]
        # a filter needs a magnetometer reading to start
        later = stream.time_s[seen[np.searchsorted(stream.time_s[seen], first - 1e-9) :]]
        if not len(later) or later[0] > last - step_s:
            continue
        at_s = later[0] + step_s * np.arange(int((last - later[0]) / step_s + 1e-6) + 1)
        rates = _line(at_s, time_s, gyro[whole])
        yield UnitSegment(
            time_s=at_s,
            step_s=step_s,
            gyro_rad_s=np.vstack([rates[:1], 0.5 * (rates[1:] + rates[:-1])]),
            accel_m_s2=_line(at_s, time_s, accel[whole]),
            mag_ut=_near(at_s, stream.time_s[seen], mag[seen], 0.6 * step_s),
            gyro_std_rad_s=gyro_std_rad_s,
        )


def orientations(stretches_found: list[tuple[UnitSegment, Floats]], at_s: Floats) -> Floats:
    """Quaternions (N, 4) at other time stamps, interpolated linearly and normalised; NaN outside the stretches."""
    found = np.full((len(at_s), 4), np.nan)
    for stretch, quats in stretches_found:
        margin = 0.5 * stretch.step_s
        inside = (at_s >= stretch.time_s[0] - margin) & (at_s <= stretch.time_s[-1] + margin)
        lined = _line(at_s[inside], stretch.time_s, continuous_quat(quats))
        found[inside] = lined / np.linalg.norm(lined, axis=1, keepdims=True)
    return found


def _line(at_s: Floats, time_s: Floats, values: Floats) -> Floats:
    return np.stack([np.interp(at_s, time_s, column) for column in values.T], axis=1)


def _near(at_s: Floats, time_s: Floats, values: Floats, within_s: float) -> Floats:
    """Linear interpolation near a reading, otherwise NaN: magnetometer readings are not invented in a dropout."""
    right = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
    left = np.maximum(right - 1, 0)
    away = np.minimum(np.abs(time_s[right] - at_s), np.abs(time_s[left] - at_s))
    return np.where((away <= within_s)[:, None], _line(at_s, time_s, values), np.nan)
