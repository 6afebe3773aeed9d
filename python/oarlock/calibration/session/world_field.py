"""Compares norm and dip of the magnetic field measured in a session with the values of the model's [world]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.checks import KEPT, PASSED, REDO, Check
from oarlock.calibration.session.sensors import SensorSearch
from oarlock.calibration.static.local_field import parameter_of

if TYPE_CHECKING:
    from oarlock._core import Model

NORM_APART = 0.1
DIP_APART_RAD = float(np.radians(10.0))


def _seen(searches: Mapping[str, SensorSearch]) -> dict[str, tuple[float, float]]:
    """Unit -> norm, uT, and dip, rad, of those whose magnetometer is known."""
    return {
        name: (search.mag.norm_ut, search.mag.dip_rad)
        for name, search in searches.items()
        if search.mag is not None and search.mag.known
    }


def field_parameters(model: Model, searches: Mapping[str, SensorSearch]) -> dict[str, float]:
    """The model's parameters for the field, where it has any; see `oarlock.calibration.calibrate_field`."""
    seen = _seen(searches)
    found = {}
    for k, key in enumerate(("magnetic_norm_ut", "magnetic_dip_rad")):
        values = [s[k] for s in seen.values() if np.isfinite(s[k])]
        name = parameter_of(model, key) if values else None
        if name is not None:
            found[name] = float(np.median(values))
    return found


def field_checks(model: Model, searches: Mapping[str, SensorSearch]) -> list[Check]:
    """Each unit's norm and dip against the middle of all, and the middle against the model's world."""
    seen = _seen(searches)
    if not seen:
        return []
    norm, dip = (float(np.nanmedian([s[k] for s in seen.values()])) for k in (0, 1))
    checks = []
    for name, (own_norm, own_dip) in seen.items():
        off = abs(own_norm / norm - 1.0) > NORM_APART or abs(own_dip - dip) > DIP_APART_RAD
        if off:
            text = f"{own_norm:.1f} uT, dip {np.degrees(own_dip):.0f} deg"
            sentence = (
                f"The others see {norm:.1f} uT and {np.degrees(dip):.0f} deg: turn it again, away from iron."
            )
            checks.append(Check("turn", name, "field", text, np.nan, np.nan, "", REDO, sentence))
    world = model.describe().world
    taken = field_parameters(model, searches)
    apart = abs(norm / world.magnetic_norm_ut - 1.0) > NORM_APART
    apart |= bool(abs(dip - world.magnetic_dip_rad) > DIP_APART_RAD)
    text = f"{norm:.1f} uT, dip {np.degrees(dip):.0f} deg"
    if taken:
        outcome, sentence = PASSED, f"The model takes it as {', '.join(taken)}."
    elif apart:
        held = f"{world.magnetic_norm_ut:.1f} uT and {np.degrees(world.magnetic_dip_rad):.0f} deg"
        outcome = KEPT
        sentence = (
            f"The model's [world] has {held}: write the measured values into [world] of your model file."
        )
    else:
        outcome, sentence = PASSED, "As the model's world says."
    return [*checks, Check("turn", "", "magnetic field", text, np.nan, np.nan, "", outcome, sentence)]
