"""`with_soft_mounts`: units that turn slowly on their links become states; for `oarlock track --soft-mount`."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, inf
from typing import TYPE_CHECKING

from oarlock.model.edit import Document, document_of, model_of
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model


def with_soft_mounts(model: Model, std_rad: Mapping[str, float], time_s: float | None = None) -> Model:
    """The body with units that turn slowly on their links (docs/mounts.md).

    Args:
        model: with inertial units or orientation sensors.
        std_rad: name of a unit -> standard deviation of its rotation from its mount about each axis, rad. It includes
            how well the mount is known.
        time_s: correlation time of this rotation, s; None keeps that of the model file, 60 s by default.

    Raises:
        DataError: the model has no such unit, or a standard deviation or the time is not positive.
    """
    if time_s is not None and not 0.0 < time_s < inf:
        raise DataError(f"soft mounts: a correlation time of {time_s:g} s; expected more than 0 s")
    # Mounts with a process of their own are states of the tree alone.
    document: Document = {**document_of(model), "structure": "tree"}
    tables = {t["name"]: t for t in document.get("sensor", ()) if t["kind"] in ("imu", "orientation")}
    for name, std in std_rad.items():
        if name not in tables:
            raise DataError(
                f'the model "{model.name}" has no unit "{name}". {did_you_mean(name, list(tables))}'
            )
        if not 0.0 < std < inf:
            raise DataError(
                f'soft mount of "{name}": a standard deviation of {std:g} rad ({degrees(std):g} deg); expected more '
                "than 0, e.g. 0.09 rad (5 deg)"
            )
        soft: Document = {"turning_std_rad": float(std)}
        if time_s is not None:
            soft["turning_time_s"] = float(time_s)
        tables[name]["mount"] = {**tables[name].get("mount", {}), **soft}
    return model_of(document, model)
