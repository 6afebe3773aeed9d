"""Session search: bias and noise of gyroscopes, from intervals at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.storage.arrays import Floats

SWAY_RAD = 0.005
"""Net turn of somebody who stands still, over one stretch."""
WANDER_RAD_S = 5e-5
"""A bias is no constant: what it changes by within some seconds."""
BIAS_LIMIT_RAD_S, WORN_BIAS_LIMIT_RAD_S = 0.001, 0.003
"""Largest std that passes: of units that lay somewhere, and of units that were only worn and sway with the person."""


@dataclass(frozen=True, eq=False)
class GyroRest:
    """A gyroscope at rest: bias and its std (3,) rad/s, noise (3,) rad/s a sample, seconds of rest, whether it lay."""

    bias_rad_s: Floats
    std_rad_s: Floats
    noise_rad_s: Floats
    rest_s: float
    lay: bool

    @property
    def limit_rad_s(self) -> float:
        """Largest standard deviation that passes."""
        return BIAS_LIMIT_RAD_S if self.lay else WORN_BIAS_LIMIT_RAD_S


def gyro_rest(unit: UnitRows, stills: Sequence[tuple[Span, bool]]) -> GyroRest | None:
    """The mean over all stretches, each by its variance; None without any."""
    means, variances, noises, rest_s = [], [], [], 0.0
    for span, worn in stills:
        rows = unit.rows(span)
        gyro, length = unit.gyro[rows], span[1] - span[0]
        if len(gyro) < 8:
            continue
        noise = np.std(np.diff(gyro, axis=0), axis=0) / np.sqrt(2.0)
        sway = SWAY_RAD / length if worn else WANDER_RAD_S
        means.append(gyro.mean(axis=0))
        variances.append(np.var(gyro, axis=0) / len(gyro) + sway**2)
        noises.append(noise)
        rest_s += length
    if not means:
        return None
    weights = 1.0 / np.array(variances)
    bias = (weights * np.array(means)).sum(axis=0) / weights.sum(axis=0)
    std = 1.0 / np.sqrt(weights.sum(axis=0))
    if len(means) > 2:  # stretches that disagree by more than they should
        chi2 = (weights * (np.array(means) - bias) ** 2).sum(axis=0) / (len(means) - 1)
        std = std * np.sqrt(np.maximum(chi2, 1.0))
    lay = any(not worn for _, worn in stills)
    return GyroRest(bias, std, np.median(noises, axis=0), rest_s, lay)
