"""`fitted_axes`: axes of two hinges in a row and relative heading of the units at both ends, for `two_hinges`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.calibration.robust_fit import huber, robust_fit
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats

STARTS = 24
MISFIT_STD_RAD = float(np.radians(3.0))
"""How far skin and the joint itself let the angle between the axes change."""
ANGLE_STD = 0.1
"""Of the cosine of this angle; carrying angles of people differ by some 4 deg."""
DRIFT_STD_RAD_S = float(np.radians(0.5))
DAMPING = 1e-6
HUBER = 2.0


@dataclass(frozen=True, eq=False)
class AxesFit:
    """A solution; the opposite of each axis is another.

    Args:
        first: (3,) unit vector in the upper unit's axes.
        second: (3,) unit vector in the lower unit's axes.
        cosine: of the angle between them.
        heading_rad: (N,) turn about the vertical that takes the lower unit's world to the upper unit's.
        misfit_rad: root mean square of the change of the angle between the axes.
        stds_rad: (2,) of the axes by the rows' own noise; large where the movement does not determine them.
        estimate: (9,) axes, heading and its drift, cosine.
        cost: of the robust fit.
    """

    first: Floats
    second: Floats
    cosine: float
    heading_rad: Floats
    misfit_rad: float
    stds_rad: Floats
    estimate: Floats
    cost: float

    def apart(self, other: AxesFit) -> Floats:
        """(2,) angles between the axes of two solutions, rad."""
        cosines = [self.first @ other.first, self.second @ other.second]
        return np.asarray(np.arccos(np.clip(np.abs(cosines), 0.0, 1.0)))


def fitted_axes(
    time_s: Floats, upper: Floats, lower: Floats, cosine: float, near: AxesFit | None = None
) -> AxesFit:
    """The axes with which the angle between them changes least.

    Args:
        time_s: (N,) s.
        upper: (N, 3, 3) world from sensor of the upper unit, z up.
        lower: (N, 3, 3) of the lower unit; its heading differs.
        cosine: of the model's angle between the axes.
        near: a solution to start from; None tries many starts.
    """
    late_s = time_s - time_s.mean()
    loss = huber(HUBER)

    def linearised(estimate: Floats) -> tuple[Floats, Floats]:
        one, two, heading, drift, angle = _parts(estimate)
        turned = about_up(heading + drift * late_s) @ lower
        a, b = upper @ one, turned @ two
        by_one = np.cross(one, np.einsum("nij,ni->nj", upper, b))
        by_two = np.cross(two, np.einsum("nij,ni->nj", turned, a))
        by_heading = a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]
        columns = [by_one, by_two, by_heading[:, None], (late_s * by_heading)[:, None], -np.ones((len(a), 1))]
        slopes = np.concatenate(columns, axis=1) / MISFIT_STD_RAD
        priors = np.zeros((2, 9))
        priors[0, 7], priors[1, 8] = 1.0 / DRIFT_STD_RAD_S, 1.0 / ANGLE_STD
        known = [drift / DRIFT_STD_RAD_S, (abs(angle) - abs(cosine)) / ANGLE_STD]
        priors[1, 8] *= 1.0 if angle >= 0 else -1.0
        residuals = ((a * b).sum(axis=1) - angle) / MISFIT_STD_RAD
        return np.concatenate([residuals, known]), np.concatenate([slopes, priors])

    def solved(start: Floats) -> AxesFit:
        estimate, covariance = robust_fit(linearised, start, loss, moved=_moved, damping=DAMPING)
        residuals, _ = linearised(estimate)
        one, two, heading, drift, angle = _parts(estimate)
        misfit = float(
            np.sqrt((residuals[:-2] ** 2).mean())
            * MISFIT_STD_RAD
            / max(np.sqrt(1.0 - min(angle**2, 0.99)), 0.1)
        )
        # Axes are lines; of the two ends of the second, the one on the model's side of the first.
        side = 1.0 if angle * cosine >= 0 else -1.0
        stds = np.array([_across(one, covariance[:3, :3]), _across(two, covariance[3:6, 3:6])])
        heading_rad = heading + drift * late_s
        cost = loss(residuals)[0]
        return AxesFit(one, side * two, side * angle, heading_rad, misfit, stds, estimate, cost)

    if near is not None:
        return solved(near.estimate)
    return min((solved(start) for start in _starts()), key=lambda fit: fit.cost)


def _parts(estimate: Floats) -> tuple[Floats, Floats, float, float, float]:
    return estimate[:3], estimate[3:6], float(estimate[6]), float(estimate[7]), float(estimate[8])


def _across(axis: Floats, covariance: Floats) -> float:
    """Largest standard deviation of an axis; a step along it turns nothing."""
    across = np.eye(3) - np.outer(axis, axis)
    return float(np.sqrt(max(np.linalg.eigvalsh(across @ covariance @ across)[-1], 0.0)))


def _moved(before: Floats, step: Floats) -> Floats:
    turns = matrix_from_quat(quat_from_rotvec(step[:6].reshape(2, 3)))
    axes = (turns @ before[:6].reshape(2, 3, 1)).reshape(-1)
    return np.concatenate([axes, before[6:] + step[6:]])


def _starts() -> list[Floats]:
    random = np.random.default_rng(0)
    axes = random.standard_normal((STARTS, 2, 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    headings = np.linspace(-np.pi, np.pi, STARTS, endpoint=False)
    return [np.concatenate([a.reshape(-1), [h, 0.0, 0.0]]) for a, h in zip(axes, headings, strict=True)]


def about_up(angle_rad: Floats | float) -> Floats:
    """(..., 3, 3) turns about the third axis."""
    return matrix_from_quat(quat_from_rotvec(np.multiply.outer(angle_rad, [0.0, 0.0, 1.0])))
