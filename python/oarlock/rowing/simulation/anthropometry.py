"""Segment lengths of a rower from stature, with standard deviations: initial values for a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock import Calibration, Model

LENGTH_PER_STATURE = {
    "l_b": 0.288,
    "l_cl": 0.129,
    "l_ua": 0.186,
    "l_fa": 0.146,
    "l_ha": 0.054,
}
"""Hip to shoulder line, half the width of the shoulders, upper arm and forearm: Drillis and Contini (1966), as Winter
(Biomechanics and Motor Control of Human Movement) gives them. Wrist to the middle of the grip: half of the hand."""

SHARE_STD = 0.05
"""Relative standard deviation of people from these ratios; the population is not documented."""

STATURES_M = (1.2, 2.3)
"""Outside these a stature was meant in another unit."""


def anthropometry(model: Model, stature_m: float) -> Calibration:
    """Lengths of the body from stature, each with a standard deviation of 5 %.

    Sets those of `l_b`, `l_cl`, `l_ua`, `l_fa` and `l_ha` (with `_r` and `_l`) that the model has; the rig stays.
    `oarlock.calibration.calibrate_motion` takes the standard deviations as priors.

    Args:
        model: of a rower.
        stature_m: standing height without shoes, m.

    Raises:
        DataError: a stature outside 1.2 to 2.3 m, or a model without any of these lengths.
    """
    from oarlock import Calibration

    low, high = STATURES_M
    if not low <= stature_m <= high:
        raise DataError(f"stature: {stature_m:g} m; expected {low:g} to {high:g} m, for example 1.84")
    found = {
        name: ratio * stature_m
        for length, ratio in LENGTH_PER_STATURE.items()
        for name in (length, f"{length}_r", f"{length}_l")
        if name in model.parameters
    }
    if not found:
        raise DataError(
            f'stature: model "{model.name}" has none of the lengths {", ".join(LENGTH_PER_STATURE)} '
            "(with _r or _l)"
        )
    return Calibration(
        parameters=found,
        parameter_stds={name: SHARE_STD * value for name, value in found.items()},
        noted={"method": "stature", "stature_m": float(stature_m), "source": "Drillis and Contini 1966"},
    )
