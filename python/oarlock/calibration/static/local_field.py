"""`calibrate_field`: norm and dip of the local magnetic field, from still or slow intervals of a recording.

The search itself is the engine's (`calibrate::local_field`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from oarlock import _core
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected, without_mag_offsets
from oarlock.recording.inertial_units import MOVES, chosen_units, readings
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

SEARCH = "magnetic field"


def calibrate_field(
    model: Model,
    recording: Recording,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
) -> Calibration:
    """Find the field's norm and dip from still or slow stretches, for a model that has them as parameters.

    Neither mounts nor postures play a part: the norm needs no direction, and the dip only the angle between
    magnetometer and accelerometer. Medians pass over a unit that came near iron for a while.

    Args:
        model: with ``magnetic_norm_ut`` and ``magnetic_dip_rad`` of its world given by one parameter each.
        recording: gyroscope, accelerometer and magnetometer of the units.
        sensors: the units to use; None takes all of the model with a magnetometer that were recorded.
        calibration: what is known already; None is nothing.

    Returns:
        The starting calibration with the model's two parameters, or those of the two that it has. ``noted`` holds
        the field, its scatter, each unit's own figures, and ``departing_share``: how much of the calm time lies
        off the field by more than 10 % or 10 deg. Above a third the room is not one field.

    Raises:
        DataError: no unit with a magnetometer, or none that is calm for a second; with figures.
    """
    if sensors is None:
        sensors = _with_magnetometer(model, recording)
    names = chosen_units(model, recording, sensors, SEARCH, (*MOVES, "mag_ut"))
    recording = without_mag_offsets(corrected(recording, calibration), calibration)
    require_plausible(recording.only(names))
    worn = Worn.of(model, calibration)
    field = _core.find_local_field([readings(recording[name]) for name in names])
    parameters = {}
    for key, value in (("magnetic_norm_ut", field["norm_ut"]), ("magnetic_dip_rad", field["dip_rad"])):
        name = parameter_of(worn.model, key)
        if name is not None:
            parameters[name] = value
    noted = {
        "how": "magnetic field in calm stretches",
        "field": {k: v for k, v in field.items() if k != "units"},
        "sensor": {u["name"]: _figures(u) for u in field["units"]},
        "parameters_of_the_model": list(parameters),
        "left_out": [name for name in recording.names if name not in names],
    }
    return worn.calibrated({}, noted, parameters)


def _with_magnetometer(model: Model, recording: Recording) -> list[str]:
    units = chosen_units(model, recording, None, SEARCH, ())
    names = [name for name in units if readings(recording[name])["mag_ut"] is not None]
    if not names:
        raise DataError(f"{SEARCH}: none of the units {', '.join(units)} recorded mag_ut.")
    return names


def parameter_of(model: Model, key: str) -> str | None:
    """The parameter that the model file names as this number of its world, if it names one."""
    entry = tomllib.loads(model.text).get("world", {}).get(key)
    return entry.strip() if isinstance(entry, str) and entry.strip() in model.parameters else None


def _figures(unit: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in unit.items() if k != "name" and v is not None}
