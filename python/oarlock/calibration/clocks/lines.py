"""Fits offset and drift of a clock to the delays of many windows, for the fine search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from oarlock.recording.stream_scales import Clock

Floats = NDArray[np.float64]

CRYSTAL_DRIFT = 3e-5
"""Prior standard deviation of a clock's drift: quartz oscillators are specified to 20 to 50 ppm."""
_NO_CRYSTAL = 4.0
"""Standard deviations beyond which a drift is no crystal's, and nothing is expected of it."""
MODEL_STD_S = 2e-3
"""What straps, mounts and a body that is no tree add to an offset, alike in all windows, so that their scatter does
not show it. The docs' page on clocks has the figures."""
MODEL_WANDER_S = 3e-4
"""How much of that may change from one end of a recording to the other, with pace."""
_CORRELATED = np.sqrt(2.0)
"""Neighbouring windows share errors; measured as such on simulated recordings of the field."""
_HUBER = 1.5
_MANY, _LEAST_SCALE = 8, 0.2


def line(time_s: Floats, delay_s: Floats, std_s: Floats, drift_so_far: float = 0.0) -> Clock:
    """The clock whose stamps are late by ``delay_s`` (W,) at ``time_s`` (W,), with standard deviations.

    Robust least squares (Huber 1964). `std_s` (W,) says how the windows compare; how large it is their scatter says,
    where they are more than a few. `drift_so_far` was set right before: the whole drift is expected to be a crystal's.
    """
    middle = float(np.average(time_s, weights=1.0 / std_s**2))
    if len(time_s) > 2:
        fit, spread = _fitted(time_s - middle, delay_s, std_s, 0.0, 1.0)
        if abs(fit[1] + drift_so_far) > _NO_CRYSTAL * np.hypot(np.sqrt(spread[1, 1]), CRYSTAL_DRIFT):
            return _clock(fit, spread, middle, time_s)
    fit, spread = _fitted(time_s - middle, delay_s, std_s, -drift_so_far, CRYSTAL_DRIFT)
    return _clock(fit, spread, middle, time_s)


def _fitted(
    time_s: Floats, delay_s: Floats, std_s: Floats, drift: float, drift_std: float
) -> tuple[Floats, Floats]:
    """Offset and drift (2,) and their covariance (2, 2)."""
    design = np.column_stack([np.ones_like(time_s), time_s])
    prior = np.diag([0.0, drift_std**-2])
    expected = np.array([0.0, drift * drift_std**-2])
    excess, scale = np.ones_like(time_s), 1.0
    fit, normal = np.zeros(2), np.eye(2)
    for _ in range(20):
        weight = 1.0 / (scale * std_s) ** 2 / excess
        normal = design.T @ (weight[:, None] * design) + prior
        fit = np.asarray(np.linalg.inv(normal) @ (design.T @ (weight * delay_s) + expected))
        apart = np.abs(delay_s - design @ fit) / std_s
        if len(apart) > 2:
            found = 1.4826 * float(np.median(apart)) * np.sqrt(len(apart) / (len(apart) - 2))
            scale = max(_LEAST_SCALE if len(apart) >= _MANY else 1.0, found)
        excess = np.maximum(1.0, apart / scale / _HUBER)
    return fit, np.asarray(_CORRELATED**2 * np.linalg.inv(normal))


def _clock(fit: Floats, spread: Floats, middle: float, time_s: Floats) -> Clock:
    span = max(float(time_s.max() - time_s.min()), 1.0)
    drift_variance = spread[1, 1] + (MODEL_WANDER_S / span) ** 2
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
