"""Fits offset and drift of a clock to the delays of many windows, for the fine search."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from oarlock.recording.stream_scales import Clock
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import STD_OF_MAD

CRYSTAL_DRIFT = 3e-5
"""Prior standard deviation of a clock's drift: quartz oscillators are specified to 20 to 50 ppm. Its tails are those of
Student's t with one degree of freedom, so that a clearly larger drift is accepted."""
MODEL_STD_S = 2e-3
"""What straps, mounts and a body that is no tree add to an offset, alike in all windows, so that their scatter does
not show it. The docs' page on clocks has the figures."""
MODEL_WANDER_S = 3e-4
"""How much of that may change from one end of a recording to the other, with pace."""
_CORRELATED = np.sqrt(2.0)
"""Neighbouring windows share errors; measured as such on simulated recordings of the field."""
_HUBER = 1.5
_ROUNDS = 50
_MANY, _LEAST_SCALE = 8, 0.2
"""From this number of windows on, their own scatter shows how exact they are; it is never taken to be smaller."""


def line(
    time_s: Floats,
    delay_s: Floats,
    std_s: Floats,
    drift_so_far: float = 0.0,
    *,
    usual: float = 1.0,
    drift_std: float = CRYSTAL_DRIFT,
) -> Clock:
    """The clock whose stamps are late by ``delay_s`` (W,) at ``time_s`` (W,), with standard deviations.

    Robust least squares (Huber 1964). `std_s` (W,) are standard deviations up to a common factor. It follows from
    the scatter of many windows; for few it is at least `usual` (see `usual_scatter`). `drift_so_far` was corrected
    before; `drift_std` is the prior of the whole drift.
    """
    middle = float(np.average(time_s, weights=1.0 / std_s**2))
    fit, spread = _fitted(time_s - middle, delay_s, std_s, usual, (drift_so_far, drift_std))
    return _clock(fit, spread, middle, time_s)


def usual_scatter(time_s: Floats, delay_s: Floats, std_s: Floats) -> float:
    """Scatter of the delays (W, clocks) of all clocks about their lines, relative to `std_s`; 1 for few windows.

    In a short recording no clock has windows enough to show its own.
    """
    free = delay_s.shape[1] * (len(time_s) - 2)
    if free < _MANY - 2:
        return 1.0
    squares = 0.0
    for delay, std in zip(delay_s.T, std_s.T, strict=True):
        design = np.column_stack([1.0 / std, time_s / std])
        squares += float(np.linalg.lstsq(design, delay / std)[1].sum())
    return float(np.clip(np.sqrt(squares / free), _LEAST_SCALE, 1.0))


def usual_drift(clocks: Iterable[Clock]) -> float:
    """Prior standard deviation of a drift: a crystal's, or the median of these clocks' drifts if that is larger."""
    return max(CRYSTAL_DRIFT, float(np.quantile([abs(c.drift) for c in clocks], 0.5, method="lower")))


def _fitted(
    time_s: Floats, delay_s: Floats, std_s: Floats, usual: float, prior: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Offset and drift (2,) and their covariance (2, 2). `prior`: the drift so far, and the whole drift's std."""
    drift_so_far, drift_std = prior
    design = np.column_stack([np.ones_like(time_s), time_s])
    excess, scale = np.ones_like(time_s), usual
    # Degrees of freedom, own ones and of `_MANY` windows.
    own, enough = len(time_s) - 2, _MANY - 2
    least = usual if own < enough else _LEAST_SCALE
    fit, normal = np.zeros(2), np.eye(2)
    # Without a prior at first, so that a drift far beyond a crystal's is reached.
    precision = 0.0 if own > 0 else drift_std**-2
    for _ in range(_ROUNDS):
        weight = 1.0 / (scale * std_s) ** 2 / excess
        normal = design.T @ (weight[:, None] * design) + np.diag([0.0, precision])
        right = design.T @ (weight * delay_s) - [0.0, precision * drift_so_far]
        fit = np.asarray(np.linalg.inv(normal) @ right)
        precision = 2.0 / (2.0 * drift_std**2 + (fit[1] + drift_so_far) ** 2)
        apart = np.abs(delay_s - design @ fit) / std_s
        if own > 0:
            found = STD_OF_MAD**2 * float(np.median(apart)) ** 2 * len(apart) / own
            share = min(own / enough, 1.0)
            scale = max(least, float(np.sqrt(share * found + (1.0 - share) * usual**2)))
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
