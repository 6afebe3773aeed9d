"""An offset and a drift through the delays of many windows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from oarlock.stream_scales import Clock

Floats = NDArray[np.float64]

CRYSTAL_DRIFT = 1e-4
"""Standard deviation of a clock's drift before anything is measured: crystals are cut to 20 to 100 ppm."""
MODEL_STD_S = 1e-3
"""What straps, mounts and a body that is no tree add to an offset, alike in all windows, so that their scatter does
not show it. The docs' page on clocks has the figures."""
MODEL_WANDER_S = 3e-4
"""How much of that may change from one end of a recording to the other, with pace."""
_CORRELATED = np.sqrt(2.0)
"""Neighbouring windows share errors; measured as such on simulated recordings of the field."""
_HUBER = 1.5


def line(time_s: Floats, delay_s: Floats, std_s: Floats) -> Clock:
    """The clock whose stamps are late by ``delay_s`` (W,) at ``time_s`` (W,), with standard deviations.

    Robust least squares (Huber 1964) with the scatter of the windows where that is larger than `std_s` (W,) says.
    """
    middle = float(np.average(time_s, weights=1.0 / std_s**2))
    design = np.column_stack([np.ones_like(time_s), time_s - middle])
    prior = np.diag([0.0, CRYSTAL_DRIFT**-2])
    doubt, scale, fit, normal = np.ones_like(time_s), 1.0, np.zeros(2), np.eye(2)
    for _ in range(20):
        weight = 1.0 / (scale * std_s) ** 2 / doubt
        normal = design.T @ (weight[:, None] * design) + prior
        fit = np.linalg.solve(normal, design.T @ (weight * delay_s))
        apart = np.abs(delay_s - design @ fit) / std_s
        if len(apart) > 2:
            scale = max(1.0, 1.4826 * float(np.median(apart)) * np.sqrt(len(apart) / (len(apart) - 2)))
        doubt = np.maximum(1.0, apart / scale / _HUBER)
    spread = _CORRELATED**2 * np.linalg.inv(normal)
    span = max(float(time_s.max() - time_s.min()), 1.0)
    drift_variance = min(spread[1, 1] + (MODEL_WANDER_S / span) ** 2, CRYSTAL_DRIFT**2)
    # The delay is that of a stamp read now; the clock's own figures count true time from zero.
    offset = fit[0] - fit[1] * middle
    offset_variance = spread[0, 0] + middle**2 * drift_variance + MODEL_STD_S**2
    return Clock(
        float(offset), float(fit[1]), float(np.sqrt(offset_variance)), float(np.sqrt(drift_variance))
    )


def after(first: Clock, then: Clock) -> Clock:
    """One clock for two: `then` was found on stamps that `first` had set right."""
    return Clock(
        first.offset_s + (1.0 + first.drift) * then.offset_s,
        first.drift + then.drift + first.drift * then.drift,
        then.offset_std_s,
        then.drift_std,
    )
