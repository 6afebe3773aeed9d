"""Selects the inertial units for a calibration search and converts their readings for the engine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

MOVES = ("gyro_rad_s", "accel_m_s2")


def chosen_units(
    model: Model,
    recording: Recording,
    sensors: Iterable[str] | None,
    search: str,
    needs: Sequence[str] = MOVES,
) -> list[str]:
    """Names of the units for a search: those given, or all recorded units of the model.

    Raises:
        DataError: none was recorded, a name is not an inertial unit of the model, or a stream lacks a quantity.
    """
    units = [s.name for s in model.describe().inertial_units]
    if sensors is None:
        names = [n for n in units if n in recording]
    else:
        names = [sensors] if isinstance(sensors, str) else list(sensors)
    if not names:
        raise DataError(
            f'{search}: none of the inertial units of "{model.name}" ({", ".join(units)}) was recorded; '
            f"the recording has {', '.join(recording.names)}. Rename the streams."
        )
    for name in names:
        if name not in units:
            raise DataError(
                f'{search}: the model "{model.name}" has no inertial unit "{name}". {did_you_mean(name, units)}'
            )
        stream = recording[name]
        if not isinstance(stream, ImuStream) or any(stream.values.get(field) is None for field in needs):
            raise DataError(
                f'{search}: stream "{name}" has {", ".join(stream.values)}; the search needs '
                f"{' and '.join(needs)}. Name the sensors to use."
            )
    return names


def readings(stream: object) -> dict[str, Any]:
    """A unit's columns by the names of the engine. A magnetometer without any reading counts as absent.

    A magnetometer with a rate of its own has rows without gyroscope and accelerometer. The searches need rows of these,
    so such a reading stands at the nearest row of theirs.
    """
    assert isinstance(stream, ImuStream)
    mag = None if stream.mag_ut is None or np.isnan(stream.mag_ut).all() else stream.mag_ut
    columns = [rows for rows in (stream.gyro_rad_s, stream.accel_m_s2) if rows is not None]
    moving = np.flatnonzero(~np.isnan(np.hstack(columns)).all(axis=1)) if columns else np.arange(len(stream))
    if mag is not None and len(moving) < len(stream):
        mag = at_nearest(stream.time_s, mag, moving)
    return {
        "name": stream.name,
        "time_s": stream.time_s[moving],
        "gyro_rad_s": None if stream.gyro_rad_s is None else stream.gyro_rad_s[moving],
        "accel_m_s2": None if stream.accel_m_s2 is None else stream.accel_m_s2[moving],
        "mag_ut": mag,
    }


def at_nearest(time_s: Floats, mag: Floats, kept: Ints) -> Floats:
    """The readings (T, 3) at the kept rows; those of other rows at the kept row that is nearest in time."""
    rows = np.flatnonzero(np.isfinite(mag).any(axis=1))
    middles = 0.5 * (time_s[kept][1:] + time_s[kept][:-1])
    found = np.full((len(kept), mag.shape[1]), np.nan)
    found[np.searchsorted(middles, time_s[rows])] = mag[rows]
    return found
