"""`load_model` reads shipped and own model files; `Base` describes the motion of the root."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from oarlock._core import Model
from oarlock.model.anthropometry import for_person
from oarlock.model.extends import model_file
from oarlock.model.html import model_html
from oarlock.model.shipped_files import model_names, model_path
from oarlock.storage.errors import DataError, ModelError
from oarlock.storage.regular_file import UnreadableFileError, read_text
from oarlock.storage.suggest import did_you_mean

setattr(Model, "_repr_html_", model_html)  # noqa: B010  the class is the engine's, which writes no HTML


@dataclass(frozen=True)
class Base:
    """How the root moves, for `Model.predict_measurements`. One motion, or one for each row of q.

    Args:
        rotation: (..., 3, 3) world from root.
        angular_velocity_rad_s: (..., 3) in root axes.
        angular_acceleration_rad_s2: (..., 3) in root axes.
        acceleration_m_s2: (..., 3) coordinate acceleration of the root's origin, in root axes, without gravity.
    """

    rotation: ArrayLike
    angular_velocity_rad_s: ArrayLike = (0.0, 0.0, 0.0)
    angular_acceleration_rad_s2: ArrayLike = (0.0, 0.0, 0.0)
    acceleration_m_s2: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        rows = np.shape(self.rotation)[:-2]
        for name in ("angular_velocity_rad_s", "angular_acceleration_rad_s2", "acceleration_m_s2"):
            object.__setattr__(self, name, np.broadcast_to(np.asarray(getattr(self, name)), (*rows, 3)))


def load_model(
    name: str | PathLike[str],
    parameters: Mapping[str, float] | None = None,
    *,
    stature_m: float | None = None,
    mass_kg: float | None = None,
) -> Model:
    """Read a model.

    Args:
        name: of a shipped model, or a model file (docs/model-files.md).
        parameters: values that replace defaults, m or rad.
        stature_m: standing height without shoes; sets a body's lengths, with 5 %.
        mass_kg: with a stature, sets the radii of limbs.

    Raises:
        ModelError: no such model, or mistakes in its file, with lines.
        DataError: an unknown parameter, or a stature without a body's lengths.
    """
    shipped = model_names()
    path = model_path(str(name)) if str(name) in shipped else Path(name)
    try:
        text = read_text(path)
    except UnreadableFileError as error:
        why = getattr(error.__cause__, "strerror", None) or error.__cause__
        raise ModelError(
            f"{str(name)[:80]}: no shipped model has this name, and no file can be read there ({why}). "
            f"{did_you_mean(str(name), shipped)}"
        ) from None
    except DataError as error:
        raise ModelError(str(error)) from None
    file = model_file(path, text)
    try:
        if stature_m is None and mass_kg is None:
            return Model.from_toml(file.text, file.path, dict(parameters or {}))
        person = for_person(Model.from_toml(file.text, file.path, {}), stature_m, mass_kg)
        return person.with_parameters(parameters)
    except ModelError as error:
        raise ModelError(file.located(str(error))) from None
