"""Session search: hard and soft iron by an ellipsoid fit (Gebre-Egziabher et al. 2001; Kok 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.session.robust_fit import robust_fit
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.storage.array_gate import FloatArray

MOST_ROWS = 1500
ROW_STD_UT = 1.5
OFFSET_PRIOR_UT = 60.0
SOFT_PRIOR = 0.15
DIP_STD = 0.05
OFFSET_LIMIT_UT = 1.0
LEAST_COVERAGE = 0.08
"""Smallest share of the squared directions along one axis; a third each if all are seen alike."""
NORM_LIMIT = 0.05
"""Scatter of the norm, as a share, that still is one field."""


@dataclass(frozen=True, eq=False)
class MagFit:
    """Offset (3,) uT, matrix (3, 3), norm uT and dip rad of the field, std of the offset, coverage, scatter."""

    offset_ut: FloatArray
    matrix: FloatArray
    norm_ut: float
    dip_rad: float
    offset_std_ut: FloatArray
    coverage: float
    before: float
    after: float

    @property
    def known(self) -> bool:
        """Whether the unit was turned enough, and what is left is one field."""
        told = bool((self.offset_std_ut <= OFFSET_LIMIT_UT).all()) and self.coverage >= LEAST_COVERAGE
        return told and self.after <= NORM_LIMIT


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
    at_rest = _at_rest(unit, stills)
    norm = float(np.median(np.linalg.norm(rows - rows.mean(axis=0), axis=1)))
    start = np.concatenate([rows.mean(axis=0), np.zeros(5), [norm, 0.0]])

    def misses(p: FloatArray) -> FloatArray:
        matrix, field = _matrix(p[3:8]), p[8]
        apart = np.linalg.norm((rows - p[:3]) @ matrix.T, axis=1) - field
        dips = [(up @ matrix @ (m - p[:3]) / field + p[9]) / DIP_STD for up, m in at_rest]
        prior = np.concatenate([(p[:3] - start[:3]) / OFFSET_PRIOR_UT, p[3:8] / SOFT_PRIOR])
        return np.concatenate([apart / ROW_STD_UT, dips, prior])

    found, covariance = robust_fit(misses, start)
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
        float(np.arcsin(np.clip(found[9], -1.0, 1.0))) if at_rest else np.nan,
        offset_std,
        coverage,
        float(raw.std() / raw.mean()),
        float(norms.std() / norms.mean()),
    )


def _matrix(p: FloatArray) -> FloatArray:
    """Symmetric, with a mean stretch of one."""
    xx, yy, xy, xz, yz = p
    return np.asarray(np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]))


def _at_rest(unit: UnitRows, stills: Sequence[tuple[Span, bool]]) -> list[tuple[FloatArray, FloatArray]]:
    """Up and the magnetometer's mean in each still stretch."""
    assert unit.mag is not None
    found = []
    for span, _ in stills:
        rows = unit.rows(span)
        mag = unit.mag[rows]
        mag = mag[np.isfinite(mag).all(axis=1)]
        if len(mag) >= 4:
            up = unit.accel[rows].mean(axis=0)
            found.append((up / np.linalg.norm(up), mag.mean(axis=0)))
    return found
