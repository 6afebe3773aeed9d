"""Clock offsets of units on strapdown links, from how well joints close. `calibrate_clocks` uses it.

A unit that reports late turns at the wrong time, so its joints open in fast movement. The misfit of all joints (the sum
of the normalised innovations squared of their readings) is a parabola in each unit's offset; its minimum is the offset.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from oarlock import _core
from oarlock._core import Config, Model
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

STEP_S = 0.010
"""Distance of the points of a parabola."""
ROUNDS = 3
MOST_S = 0.05
PRIOR_STD_S = 0.015
"""Of an offset: recorders start their units within some samples of each other."""
MOST_PAIRED = 6
"""With more units, how they depend on each other is left to the rounds."""
SETTLE_SHARE, SETTLE_S = 0.2, 10.0
"""The start is no part of the misfit: this share of the recording, at most this long."""
CORRELATED = 20.0
"""Readings of joints 0.02 s apart with a correlation time of 0.2 s: this many are worth one."""
SAME_RATE = 1e-9
"""Standard deviation of drifts: units of one recorder run equally fast."""


def offsets_of_units(
    model: Model,
    recording: Recording,
    calibration: Calibration,
    groups: Sequence[tuple[str, ...]],
    progress: Callable[[float], object],
) -> dict[str, Clock]:
    """Offset of each stream's clock, with its standard deviation.

    Offsets are against the streams that are in no group; if there are none, against the mean of all.
    """
    against_all = len(recording) == sum(len(group) for group in groups)
    free = list(groups)[1:] if against_all else list(groups)
    misfit = _Misfit(model, recording, calibration, free)
    offsets, covariance = np.zeros(len(free)), np.eye(len(free))
    for k in range(ROUNDS):
        middle, slope, bend, degrees = misfit.parabola(offsets)
        if not degrees:
            raise DataError(
                "calibrate_clocks: no joint was read after the first seconds, so nothing shows the clocks. Record at "
                "least 10 s of movement, and run oarlock track and read its notes first"
            )
        weight = middle * CORRELATED / degrees / PRIOR_STD_S**2
        # A direction in which the misfit is no valley is left to the prior.
        values, axes = np.linalg.eigh(bend)
        curved = (axes * np.maximum(values, 0.0)) @ axes.T + weight * np.eye(len(free))
        step = np.linalg.solve(curved, -0.5 * slope - weight * offsets)
        offsets = np.clip(offsets + np.clip(step, -STEP_S, STEP_S), -MOST_S, MOST_S)
        covariance = weight * PRIOR_STD_S**2 * np.linalg.inv(curved)
        progress((k + 1) / ROUNDS)
    stds = np.sqrt(np.diag(covariance))
    if against_all:
        offsets = np.concatenate([[0.0], offsets])
        offsets -= offsets.mean()
        stds = np.concatenate([[stds.min(initial=PRIOR_STD_S)], stds])
    return {
        name: Clock(float(x), 0.0, float(std), SAME_RATE)
        for group, x, std in zip(groups, offsets, stds, strict=True)
        for name in group
    }


class _Misfit:
    """How badly joints close at some offsets."""

    def __init__(
        self, model: Model, recording: Recording, calibration: Calibration, groups: Sequence[tuple[str, ...]]
    ) -> None:
        self._model, self._recording, self._calibration = model, recording, calibration
        self._groups = groups

    def parabola(self, at: Floats) -> tuple[float, Floats, Floats, int]:
        """Value, first and second coefficients (n,), (n, n) about some offsets, and the number of readings."""
        n = len(at)
        middle, degrees = self._at(at)
        unit = STEP_S * np.eye(n)
        ends = np.array([[self._at(at + sign * unit[i])[0] for sign in (1.0, -1.0)] for i in range(n)])
        slope = (ends[:, 0] - ends[:, 1]) / (2.0 * STEP_S)
        bend = np.diag((ends.sum(axis=1) - 2.0 * middle) / (2.0 * STEP_S**2))
        for i in range(n):
            for j in range(i if n <= MOST_PAIRED else 0):
                both = self._at(at + unit[i] + unit[j])[0]
                bend[i, j] = bend[j, i] = (both - ends[i, 0] - ends[j, 0] + middle) / (2.0 * STEP_S**2)
        return middle, slope, bend, degrees

    def _at(self, offsets: Floats) -> tuple[float, int]:
        """Sum of the normalised innovations squared of joints, and their number of rows."""
        pairs = zip(self._groups, offsets, strict=True)
        clocks = {name: Clock(float(offset)) for group, offset in pairs for name in group}
        shifted = replace(self._calibration, clocks=clocks)
        run = _core.track(self._model, self._recording, shifted, Config(magnetometer="off"), None, None)
        infos, time_s = run.infos(), run.time_s()
        settled_s = time_s[0] + min(SETTLE_S, SETTLE_SHARE * (time_s[-1] - time_s[0]))
        used = (time_s > settled_s) & np.isfinite(infos["inertial_nis"])
        return float(infos["inertial_nis"][used].sum()), int(infos["inertial_used"][used].sum())
