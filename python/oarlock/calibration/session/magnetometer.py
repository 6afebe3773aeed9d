"""Session search: hard and soft iron by an ellipsoid fit (Gebre-Egziabher et al. 2001; Kok 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.robust_fit import huber, robust_fit
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.storage.arrays import Floats

MOST_ROWS = 1500
ROW_STD_UT = 1.5
OFFSET_PRIOR_UT = 60.0
SOFT_PRIOR = 0.15
DIP_STD = 0.05
OFFSET_LIMIT_UT = 1.0
LEAST_COVERAGE = 0.08
"""Smallest share of the squared directions along one axis; a third each if all are seen alike."""
OUTLIER_STDS = 3.0
NORM_LIMIT = 0.05
"""Scatter of the norm, as a share, that still is one field."""


@dataclass(frozen=True, eq=False)
class MagFit:
    """Offset (3,) uT, matrix (3, 3), norm uT and dip rad of the field, std of the offset, coverage, scatter."""

    offset_ut: Floats
    matrix: Floats
    norm_ut: float
    dip_rad: float
    offset_std_ut: Floats
    coverage: float
    before: float
    after: float

    @property
    def known(self) -> bool:
        """Whether the unit was turned enough, and what is left is one field."""
        determined = bool((self.offset_std_ut <= OFFSET_LIMIT_UT).all()) and self.coverage >= LEAST_COVERAGE
        return determined and self.after <= NORM_LIMIT


def mag_fit(unit: UnitRows, spans: Sequence[Span], stills: Sequence[tuple[Span, bool]]) -> MagFit | None:
    """One symmetric matrix and one offset for which all readings have one norm, and at rest one dip.

    The matrix has a mean scale of one, because a magnetometer cannot determine the true norm of the field.
    """
    if unit.mag is None:
        return None
    parts = [unit.mag[unit.rows(s)] for s in spans] or [unit.mag]
    rows = np.concatenate(parts)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 50:
        return None
    rows = rows[:: max(1, len(rows) // MOST_ROWS)]
    ups, resting = _at_rest(unit, stills)
    norm = float(np.median(np.linalg.norm(rows - rows.mean(axis=0), axis=1)))
    start = np.concatenate([rows.mean(axis=0), np.zeros(5), [norm, 0.0]])

    readings = _EllipsoidProblem(rows, ups, resting, start)
    found, covariance = robust_fit(readings.linearised, start, huber(OUTLIER_STDS))
    offset_std = np.sqrt(np.diag(covariance)[:3])
    matrix, offset = _matrix(found[3:8]), found[:3]
    field = (rows - offset) @ matrix.T
    norms = np.linalg.norm(field, axis=1)
    raw = np.linalg.norm(rows, axis=1)
    directions = field / norms[:, None]
    coverage = float(np.linalg.eigvalsh(directions.T @ directions / len(directions))[0])
    return MagFit(
        offset,
        matrix,
        float(found[8]),
        float(np.arcsin(np.clip(found[9], -1.0, 1.0))) if len(ups) else np.nan,
        offset_std,
        coverage,
        float(raw.std() / raw.mean()),
        float(norms.std() / norms.mean()),
    )


@dataclass(frozen=True, eq=False)
class _EllipsoidProblem:
    """Readings (n, 3) uT, up (k, 3) and mean readings (k, 3) uT of the intervals at rest, and the prior mean.

    The unknowns are offset (3), matrix (5), norm of the field, uT, and sine of its dip.
    """

    rows_ut: Floats
    ups: Floats
    resting_ut: Floats
    expected: Floats

    def linearised(self, p: Floats) -> tuple[Floats, Floats]:
        """Residuals (n + k + 8,) of norms, dips and prior, in standard deviations, and their Jacobian."""
        parts = self._norms(p), self._dips(p), self._prior(p)
        return np.concatenate([r for r, _ in parts]), np.concatenate([s for _, s in parts])

    def _norms(self, p: Floats) -> tuple[Floats, Floats]:
        matrix, offsetless = _matrix(p[3:8]), self.rows_ut - p[:3]
        field = offsetless @ matrix.T
        norms = np.linalg.norm(field, axis=1)
        along = field / norms[:, None]
        slopes = [-along @ matrix, _by_matrix(along, offsetless), np.tile([-1.0, 0.0], (len(along), 1))]
        return (norms - p[8]) / ROW_STD_UT, np.hstack(slopes) / ROW_STD_UT

    def _dips(self, p: Floats) -> tuple[Floats, Floats]:
        matrix, offsetless, norm = _matrix(p[3:8]), self.resting_ut - p[:3], p[8]
        sines = np.einsum("ki,ij,kj->k", self.ups, matrix, offsetless) / norm
        by_norm_and_dip = np.column_stack([-sines / norm, np.ones_like(sines)])
        slopes = [-self.ups @ matrix / norm, _by_matrix(self.ups, offsetless) / norm, by_norm_and_dip]
        return (sines + p[9]) / DIP_STD, np.hstack(slopes) / DIP_STD

    def _prior(self, p: Floats) -> tuple[Floats, Floats]:
        std = np.repeat([OFFSET_PRIOR_UT, SOFT_PRIOR, 1.0], [3, 5, 1])
        # Without rests nothing shows the dip.
        rows = [*range(8), 9][: 8 if len(self.ups) else 9]
        return (p - self.expected)[rows] / std[: len(rows)], np.eye(10)[rows] / std[: len(rows), None]


def _matrix(p: Floats) -> Floats:
    """Symmetric, with a mean stretch of one."""
    xx, yy, xy, xz, yz = p
    return np.asarray(np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]))


_BY_ENTRY = np.stack([_matrix(p) - np.eye(3) for p in np.eye(5)])


def _by_matrix(left: Floats, right: Floats) -> Floats:
    """(n, 5) derivatives of ``left @ _matrix(p) @ right`` by p, for rows of vectors (n, 3)."""
    return np.asarray(np.einsum("ni,kij,nj->nk", left, _BY_ENTRY, right))


def _at_rest(unit: UnitRows, stills: Sequence[tuple[Span, bool]]) -> tuple[Floats, Floats]:
    """Up (k, 3) and the magnetometer's mean (k, 3), uT, in each interval at rest."""
    assert unit.mag is not None
    ups, means = [], []
    for span, _ in stills:
        rows = unit.rows(span)
        mag = unit.mag[rows]
        mag = mag[np.isfinite(mag).all(axis=1)]
        if len(mag) >= 4:
            up = unit.accel[rows].mean(axis=0)
            ups.append(up / np.linalg.norm(up))
            means.append(mag.mean(axis=0))
    return np.reshape(ups, (-1, 3)), np.reshape(means, (-1, 3))
