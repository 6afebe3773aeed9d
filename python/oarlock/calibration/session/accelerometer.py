"""Session search: bias and scale of an accelerometer from the norm of gravity at rest (Ferraris et al. 1995)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.robust_fit import huber, robust_fit
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.storage.arrays import Floats

BIAS_PRIOR_M_S2 = 0.3
SCALE_PRIOR = 0.02
REST_STD_M_S2 = 0.01
BIAS_LIMIT_M_S2 = 0.05
LEAST_ATTITUDES = 6
APART = np.cos(np.radians(20.0))
OUTLIER_STDS = 3.0


@dataclass(frozen=True, eq=False)
class AccelRest:
    """Bias (3,) m/s2, scale (3,), the bias's std, number of attitudes, and the worst norm's error before and after."""

    bias_m_s2: Floats
    scale: Floats
    bias_std_m_s2: Floats
    attitudes: int
    before_m_s2: float
    after_m_s2: float

    @property
    def known(self) -> bool:
        """Whether the attitudes determine all three axes."""
        return self.attitudes >= LEAST_ATTITUDES and bool((self.bias_std_m_s2 <= BIAS_LIMIT_M_S2).all())


def accel_rest(unit: UnitRows, stills: Sequence[tuple[Span, bool]], gravity_m_s2: float) -> AccelRest | None:
    """``reading = scale * true + bias``, so that ``|true|`` is gravity wherever the unit rests."""
    means = [unit.accel[rows].mean(axis=0) for s, _ in stills if len(unit.accel[rows := unit.rows(s)]) >= 8]
    if not means:
        return None
    forces = np.array(means)
    prior = 1.0 / np.repeat([BIAS_PRIOR_M_S2, SCALE_PRIOR], 3)

    def linearised(p: Floats) -> tuple[Floats, Floats]:
        true = (forces - p[:3]) / (1.0 + p[3:])
        norms = np.linalg.norm(true, axis=1)
        by_bias = -true / norms[:, None] / (1.0 + p[3:])
        residuals = np.concatenate([(norms - gravity_m_s2) / REST_STD_M_S2, p * prior])
        slopes = np.concatenate([np.hstack([by_bias, by_bias * true]) / REST_STD_M_S2, np.diag(prior)])
        return residuals, slopes

    found, covariance = robust_fit(linearised, np.zeros(6), huber(OUTLIER_STDS))
    bias_std = np.sqrt(np.diag(covariance)[:3])
    left = linearised(found)[0][: len(forces)] * REST_STD_M_S2
    before = np.linalg.norm(forces, axis=1) - gravity_m_s2
    return AccelRest(
        found[:3],
        1.0 + found[3:],
        bias_std,
        _attitudes(forces),
        float(np.abs(before).max()),
        float(np.abs(left).max()),
    )


def _attitudes(forces: Floats) -> int:
    """How many directions lie 20 deg or more apart."""
    kept: list[Floats] = []
    for up in forces / np.linalg.norm(forces, axis=1, keepdims=True):
        if all(up @ other < APART for other in kept):
            kept.append(up)
    return len(kept)
