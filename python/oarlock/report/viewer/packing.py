"""Packs numbers for the viewer: int16 steps between a column's minimum and maximum, in base64."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np

from oarlock.storage.arrays import Floats

STEPS = 65534
"""Steps between minimum and maximum; one value is reserved for NaN."""
MISSING = -32768


def packed(values: Floats) -> dict[str, Any]:
    """Values (N, C) as int16 row by row; value = offset + scale * step, and -32768 is NaN.

    The error is at most half a step: 8 um where a column spans 1 m. A column that never changes has scale 0 and no
    steps.
    """
    table = np.asarray(values, dtype=np.float64)
    there = np.isfinite(table)
    least = np.where(there, table, np.inf).min(axis=0, initial=np.inf)
    greatest = np.where(there, table, -np.inf).max(axis=0, initial=-np.inf)
    still = there.all(axis=0) & (greatest == least)
    empty = least > greatest
    least, greatest = np.where(empty, 0.0, least), np.where(empty, 0.0, greatest)
    scale = np.where(greatest > least, (greatest - least) / STEPS, 1.0)
    offset = 0.5 * (least + greatest)
    steps = np.where(there, np.rint((np.where(there, table, 0.0) - offset) / scale), MISSING)
    return {
        "rows": table.shape[0],
        "offset": [float(value) for value in offset],
        "scale": [float(value) for value in np.where(still, 0.0, scale)],
        "data": base64.b64encode(steps[:, ~still].astype("<i2").tobytes()).decode("ascii"),
    }


def unpacked(packet: Mapping[str, Any]) -> Floats:
    """Unpack the values (N, C) of `packed`, exact to half a step."""
    scale, offset = np.array(packet["scale"]), np.array(packet["offset"])
    moving = np.flatnonzero(scale)
    steps = np.frombuffer(base64.b64decode(packet["data"]), dtype="<i2").reshape(packet["rows"], len(moving))
    values: Floats = np.tile(offset, (packet["rows"], 1))
    values[:, moving] = np.where(steps == MISSING, np.nan, steps * scale[moving] + offset[moving])
    return values


def packed_times(time_s: Floats) -> dict[str, Any]:
    """Times (N,) s without loss."""
    return {"data": base64.b64encode(np.asarray(time_s, dtype="<f8").tobytes()).decode("ascii")}
