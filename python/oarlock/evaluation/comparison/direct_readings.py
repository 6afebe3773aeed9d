"""Joint coordinates that an encoder or input stream measures directly, for estimators without a filter for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ScalarStream
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model


def direct_readings(
    model: Model, recording: Recording, time_s: Floats
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Readings of encoders and input streams at other time stamps, linearly interpolated, but not across gaps.

    Returns:
        Coordinate -> (T,) rad or m, NaN without a near reading; and coordinate -> standard deviation, if it has one.
    """
    described = model.describe()
    joints = {s.name: s.joint for s in described.encoders}
    joints |= {j.name: j.name for j in described.inputs}
    noise = {s.joint: s.std for s in described.encoders if s.std}
    readings: dict[str, Floats] = {}
    for stream in recording:
        joint = joints.get(stream.name)
        if isinstance(stream, ScalarStream) and joint in model.coordinate_names and joint not in readings:
            assert joint is not None
            there = np.isfinite(stream.value)
            if there.any():
                readings[joint] = _between(time_s, stream.time_s[there], stream.value[there], stream.rate_hz)
    return readings, {joint: float(std) for joint, std in noise.items() if joint in readings}


def _between(at_s: Floats, time_s: Floats, value: Floats, rate_hz: float) -> Floats:
    reach_s = 1.5 / rate_hz if rate_hz > 0.0 else 0.0
    right = np.clip(np.searchsorted(time_s, at_s), 0, len(time_s) - 1)
    away = np.minimum(np.abs(time_s[right] - at_s), np.abs(time_s[np.maximum(right - 1, 0)] - at_s))
    return np.where(away <= reach_s, np.interp(at_s, time_s, value), np.nan)
