"""Short simulated sessions with chosen effects, made once, and how two of them differ."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from exact_recording import UNITS, sculler
from oarlock.rowing import FieldEffects, FieldTrial, simulate_field
from oarlock.storage.arrays import Floats

DURATION_S, SEED = 3.0, 5
SILENT = replace(FieldEffects.off(), noise_factor=0.0)
SAME = 1e-9
"""Relative: what is drawn with an exact strength is met but for rounding."""
BETWEEN_SAMPLES = 5e-3
"""Relative: the peak of a course lies between two samples."""


@cache
def trial(effects: FieldEffects = SILENT, condition: str = "B-NB", **settings: Any) -> FieldTrial:
    asked = {"duration_s": DURATION_S, "rate_spm": 30.0, "seed": SEED} | settings
    return simulate_field(sculler(), effects, condition=condition, **asked)


def with_only(**strengths: float) -> FieldTrial:
    return trial(replace(SILENT, **strengths))


def changed(one: FieldTrial, other: FieldTrial) -> set[str]:
    """`stream.field` of everything that differs between two recordings, and the truth's parts."""
    found = set()
    for a, b in zip(one.recording, other.recording, strict=True):
        if not np.array_equal(a.time_s, b.time_s):
            found.add(f"{a.name}.time_s")
        for field, values in a.values.items():
            if values.shape != b.values[field].shape or not np.allclose(
                values, b.values[field], rtol=0, atol=1e-7
            ):
                found.add(f"{a.name}.{field}")
    if not np.allclose(one.truth.q, other.truth.q, rtol=0, atol=1e-12):
        found.add("truth")
    return found


def of_all_units(*fields: str) -> set[str]:
    return {f"{unit}.{field}" for unit in UNITS for field in fields}


def angle_rad(rotation: Floats) -> Floats:
    """Angle (...) of rotations (..., 3, 3); small ones are read from the sine."""
    upper = np.stack(
        [rotation[..., i, j] - rotation[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1
    )
    return np.arctan2(np.linalg.norm(upper, axis=-1), np.trace(rotation, axis1=-2, axis2=-1) - 1.0)
