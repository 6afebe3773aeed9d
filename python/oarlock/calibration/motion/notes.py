"""Converts the result of `calibrate_motion` to plain numbers, for a calibration's `noted` and the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from oarlock.calibration.motion.searched_model import PLACE, ZERO

if TYPE_CHECKING:
    from oarlock.calibration.motion.constants import Constants


def noted(constants: Constants | None, kept: str, scores: Mapping[str, float]) -> dict[str, Any]:
    """`kept`, `scores` (NIS per held-out reading), and by name of each constant its prior, found, std and share."""
    notes: dict[str, Any] = {"method": "motion", "kept": kept, "scores": dict(scores)}
    if constants is None:
        return notes | {"constant": {}, "not_told": []}
    rows = zip(
        constants.names,
        constants.units,
        constants.start,
        constants.moved,
        constants.prior_std,
        constants.std,
        constants.share,
        strict=True,
    )
    return notes | {
        "constant": {
            plain(name): {
                "unit": unit,
                "prior": float(start),
                "prior_std": float(prior_std),
                "found": float(start + moved),
                "std": float(std),
                "share_told": max(0.0, float(share)),
            }
            for name, unit, start, moved, prior_std, std, share in rows
        },
        "not_told": [plain(name) for name in constants.undetermined],
    }


def plain(name: str) -> str:
    """`parameters.search_place_back_x` as `back.place_x`, `search_zero_seat` as `seat.zero`, and lengths by name."""
    name = name.removeprefix("parameters.")
    if name.startswith(f"{PLACE}_"):
        unit, _, axis = name.removeprefix(f"{PLACE}_").rpartition("_")
        return f"{unit}.place_{axis}"
    return f"{name.removeprefix(f'{ZERO}_')}.zero" if name.startswith(f"{ZERO}_") else name
