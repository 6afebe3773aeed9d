"""One look at some seconds of movement: by how much each clock is late. For live sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from oarlock._core import Model
from oarlock.calibration.clocks.scores import Filtering, bare
from oarlock.calibration.clocks.search import with_clocks
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.storage.errors import DataError

LEAST_S = 12.0
"""The filter needs 4 s to settle, and two windows of 5 s show whether they agree."""


def late_clocks(
    model: Model,
    recording: Recording,
    groups: Sequence[tuple[str, ...]],
    so_far_s: Mapping[str, float],
    calibration: Calibration | None = None,
) -> dict[str, tuple[float, float]]:
    """By how much the stamps of each group of streams are late, s, and the standard deviation; their mean is arbitrary.

    This is one step of `calibrate_clocks` (Gauss and Newton's method), without a drift. Of 25 ms it leaves 2.

    Args:
        model: the body and its sensors.
        recording: some seconds in which the body moves.
        groups: streams that share one clock.
        so_far_s: what is known already, by the first stream of a group; the search begins there.
        calibration: mounts and lengths; None for the model's.

    Returns:
        By the first stream of each group; empty if nothing can be seen.
    """
    clocks = {name: Clock(so_far_s.get(group[0], 0.0)) for group in groups for name in group}
    now = with_clocks(recording, {name: clock for name, clock in clocks.items() if name in recording})
    span = max(float(s.time_s[0]) for s in now), min(float(s.time_s[-1]) for s in now)
    if span[1] - span[0] < LEAST_S:
        return {}
    try:
        seen = Filtering(model, bare(calibration or Calibration()), groups, False, 1).sights(now, [span])
    except DataError:
        return {}
    if len(seen) < 2:
        return {}
    delay_s, std_s = (np.array([getattr(s, key) for s in seen]) for key in ("delay_s", "std_s"))
    weight = std_s**-2
    step_s = (weight * delay_s).sum(axis=0) / weight.sum(axis=0)
    scatter = ((delay_s - step_s) ** 2 * weight).sum(axis=0) / (len(seen) - 1)
    found_std_s = np.sqrt(np.maximum(scatter, 1.0) / weight.sum(axis=0))
    return {
        group[0]: (so_far_s.get(group[0], 0.0) + float(step), float(std))
        for group, step, std in zip(groups, step_s, found_std_s, strict=True)
    }
