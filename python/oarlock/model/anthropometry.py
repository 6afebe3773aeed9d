"""Lengths of the shipped bodies from stature and mass, for `load_model`.

Sources. Drillis and Contini 1966, Body segment parameters, as D. A. Winter gives them (Biomechanics and Motor Control
of Human Movement, 4th edition, 2009, figure 4.1): limbs, shoulders, head, heights of hip and shoulder. Masses and
densities of limbs: the same book, table 4.1. Levels of the trunk: P. de Leva 1996, J. Biomech. 29, 1223-1230, table 4:
hips, navel and lower end of the breastbone of men 1.741 m tall. Hip joint: 0.36 of the width between the anterior iliac
spines to either side (Bell, Brand and Pedersen 1989, Human Movement Science 8, 3-16), a width that is taken as 0.14 of
stature.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

LENGTH_PER_STATURE = {
    "pelvis": 0.0837,
    "lumbar": 0.1238,
    "thorax": 0.288 - 0.0837 - 0.1238,
    "neck": 0.052,
    "head": 0.130,
    "shoulder": 0.129,
    "upper_arm": 0.186,
    "forearm": 0.146,
    "hand": 0.108,
    "hip": 0.36 * 0.14,
    "thigh": 0.245,
    "shank": 0.246,
    "ankle": 0.039,
    "foot": 0.152,
}
MASS_SHARE_AND_DENSITY_KG_M3 = {
    "upper_arm": (0.028, 1070.0),
    "forearm": (0.016, 1130.0),
    "thigh": (0.100, 1050.0),
    "shank": (0.0465, 1090.0),
}
"""Limbs whose units sit on a radius: that of a cylinder of the limb's mass, density and length."""

LENGTH_STD = {"hip": 0.10}
"""Relative standard deviation of people from these ratios, where it is not the usual one."""
USUAL_LENGTH_STD = 0.05
"""The ratios come from a population that is not documented."""

STATURES_M = (1.0, 2.4)
MASSES_KG = (15.0, 250.0)


def for_person(model: Model, stature_m: float | None, mass_kg: float | None) -> Model:
    """The model with the lengths of a person of this stature, and the radii of limbs of this mass too.

    Raises:
        DataError: a number that was meant in another unit, a mass without a stature, or a model without these lengths.
    """
    if stature_m is None and mass_kg is None:
        return model
    _check("stature_m", stature_m, STATURES_M, "m", "1.78")
    _check("mass_kg", mass_kg, MASSES_KG, "kg", "74")
    if stature_m is None:
        raise DataError("mass_kg: give stature_m too; the radius of a limb follows from both")
    changes: dict[str, Any] = {}
    for name in model.parameters:
        segment = name.removesuffix("_r").removesuffix("_l")
        limb = segment.removesuffix("_radius")
        if segment in LENGTH_PER_STATURE:
            length_m = LENGTH_PER_STATURE[segment] * stature_m
            std = LENGTH_STD.get(segment, USUAL_LENGTH_STD)
            changes[name] = {"default": length_m, "std": std * length_m}
        elif limb != segment and limb in MASS_SHARE_AND_DENSITY_KG_M3 and mass_kg is not None:
            changes[name] = {"default": radius_m(limb, stature_m, mass_kg)}
    if not changes:
        raise DataError(
            f'stature_m: the model "{model.name}" has none of the lengths {", ".join(LENGTH_PER_STATURE)} '
            "(with _r or _l); set its own parameters"
        )
    known = {name: change["default"] for name, change in changes.items()}
    return model.with_tables({"parameters": changes}).with_parameters(known)


def radius_m(limb: str, stature_m: float, mass_kg: float) -> float:
    """Radius of a cylinder with the mass, density and length of a limb."""
    share, density_kg_m3 = MASS_SHARE_AND_DENSITY_KG_M3[limb]
    length_m = LENGTH_PER_STATURE[limb] * stature_m
    return math.sqrt(share * mass_kg / (density_kg_m3 * math.pi * length_m))


def _check(what: str, value: float | None, bounds: tuple[float, float], unit: str, example: str) -> None:
    low, high = bounds
    if value is not None and not low <= value <= high:
        raise DataError(f"{what}: is {value:g}; expected {low:g} to {high:g} {unit}, for example {example}")
