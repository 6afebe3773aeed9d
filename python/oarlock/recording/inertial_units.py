"""Selects the inertial units for a calibration search and converts their readings for the engine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
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
    """A unit's columns by the names of the engine. A magnetometer without any reading counts as absent."""
    assert isinstance(stream, ImuStream)
    return {
        "name": stream.name,
        "time_s": stream.time_s,
        "gyro_rad_s": stream.gyro_rad_s,
        "accel_m_s2": stream.accel_m_s2,
        "mag_ut": None if stream.mag_ut is None or np.isnan(stream.mag_ut).all() else stream.mag_ut,
    }
