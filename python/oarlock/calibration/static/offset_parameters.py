"""Finds parameters of a model file that define only a unit's position on its link, for the searches that need them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.static.worn_model import Worn
from oarlock.model.description import ImuDescription, ModelDescription
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model

STEP_M = 0.01
"""A step, because no Jacobian contains all that a parameter may change: whole descriptions are compared."""
ROUNDING_M = 1e-9
"""A position is linear in a length: a larger deviation from the step shows an angle, or another kind of parameter."""


def own_parameters(worn: Worn, taken: Collection[str] = ()) -> dict[str, tuple[str, str, str]]:
    """Unit -> the three parameters that are its offset along x, y and z, where the model file has it so.

    A parameter that moves anything else, and one of two on the same axis, are left out.

    Args:
        worn: the model's values, and what is known.
        taken: parameters that are found otherwise.
    """
    axes: dict[str, dict[int, list[str]]] = {}
    own = worn.model.describe()
    for name, value in worn.model.parameters.items():
        if name not in taken:
            longer = worn.model.with_parameters({name: value + STEP_M}).describe()
            for unit, axis in _moved_alone(own, longer):
                axes.setdefault(unit, {}).setdefault(axis, []).append(name)
    found = {unit: [names.get(axis, []) for axis in range(3)] for unit, names in axes.items()}
    return {
        unit: (alone[0][0], alone[1][0], alone[2][0])
        for unit, alone in found.items()
        if all(len(names) == 1 for names in alone)
    }


def place_parameters(model: Model) -> set[str]:
    """Parameters that say where one unit sits on its link, and nothing else."""
    own = model.describe()
    longer = {
        name: model.with_parameters({name: x + STEP_M}).describe() for name, x in model.parameters.items()
    }
    return {name for name, moved in longer.items() if _moved_alone(own, moved)}


def offset_parameters(
    worn: Worn, offsets: Mapping[str, Floats], taken: Collection[str]
) -> dict[str, dict[str, float]]:
    """Unit -> its three parameters and what they have to be for these offsets, where the model file has it so.

    A unit whose mount the calibration holds, which the parameters then do not reach, is left alone.

    Args:
        worn: the model's values, and what is known.
        offsets: unit -> (3,) m, in its link's axes.
        taken: parameters that are found otherwise.
    """
    found = {}
    for unit, names in own_parameters(worn, taken).items():
        if unit in offsets and unit not in worn.before.mounts:
            moved = offsets[unit] - worn.offsets[unit]
            found[unit] = {
                name: worn.model.parameters[name] + float(moved[k]) for k, name in enumerate(names)
            }
    return found


def _moved_alone(model: ModelDescription, longer: ModelDescription) -> list[tuple[str, int]]:
    """The unit and the axis along which a longer parameter moves it and nothing else, metre for metre; else nothing."""
    here, there = _places(model), _places(longer)
    moved = {unit: there[unit] - here[unit] for unit in here}
    moved = {unit: by for unit, by in moved.items() if np.abs(by).max() > ROUNDING_M}
    if len(moved) != 1 or _without_places(model) != _without_places(longer):
        return []
    ((unit, by),) = moved.items()
    axis = int(np.argmax(np.abs(by)))
    follows = np.abs(by - STEP_M * np.eye(3)[axis]).max() < ROUNDING_M
    return [(unit, axis)] if follows else []


def _places(model: ModelDescription) -> dict[str, Floats]:
    return {s.name: np.asarray(s.mount.offset) for s in model.inertial_units}


def _without_places(model: ModelDescription) -> ModelDescription:
    sensors = (
        replace(sensor, mount=replace(sensor.mount, offset=(0.0, 0.0, 0.0)))
        if isinstance(sensor, ImuDescription)
        else sensor
        for sensor in model.sensors
    )
    return replace(model, parameters=(), sensors=tuple(sensors))
