"""Solves for a mount from directions in sensor and link: Wahba's problem (1965) with full covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.storage.array_gate import FloatArray

PRIOR_STD_RAD = float(np.radians(60.0))
"""Weight of the nominal mount: it only decides directions that nothing else determines."""
SHARED = 0.5
"""Share of the variance that postures have in common in which a direction is the same: people repeat their errors."""
ALIKE = float(np.cos(np.radians(15.0)))
TURNS = 30
HUBER = 2.5


@dataclass(frozen=True, eq=False)
class Sight:
    """One direction.

    Args:
        step: of the plan.
        kind: `up`, `axis` or `north`.
        in_sensor: (3,) unit vector.
        in_link: (3,) unit vector.
        own: (3, 3) covariance of the sensor's part, rad2.
        posture: (3, 3) covariance of the posture's part, rad2.
    """

    step: str
    kind: str
    in_sensor: FloatArray
    in_link: FloatArray
    own: FloatArray
    posture: FloatArray


@dataclass(frozen=True, eq=False)
class SolvedMount:
    """A rotation.

    Args:
        link_from_sensor: (3, 3).
        covariance: (3, 3) rad2, of small turns about the link's axes.
        off_rad: how far each sight is off, rad.
        off_stds: the same in its standard deviations.
    """

    link_from_sensor: FloatArray
    covariance: FloatArray
    off_rad: tuple[float, ...]
    off_stds: tuple[float, ...]

    @property
    def std_rad(self) -> FloatArray:
        """(3,) about the link's axes."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def worst_std_rad(self) -> float:
        """About the axis that is known least."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


def isotropic(direction: FloatArray, std_rad: float) -> FloatArray:
    """(3, 3) covariance of a unit vector that is off by `std_rad` in each of two directions."""
    return std_rad**2 * (np.eye(3) - np.outer(direction, direction))


def solved_mount(sights: Sequence[Sight], nominal: FloatArray) -> SolvedMount:
    """The most likely mount. Undetermined directions keep the nominal mount and have a large covariance."""
    rotation = _start(sights, nominal)
    weights = [np.linalg.inv(c) for c in _covariances(sights)]
    prior = np.eye(3) / PRIOR_STD_RAD**2
    information = prior
    for _ in range(TURNS):
        information, slope = prior.copy(), np.zeros(3)
        for sight, weight in zip(sights, weights, strict=True):
            seen = rotation @ sight.in_sensor
            off = seen - sight.in_link
            size = float(np.sqrt(max(float(off @ weight @ off), 1e-18)))
            jacobian = -_cross(seen)
            trusted = weight * min(1.0, HUBER / size)
            information += jacobian.T @ trusted @ jacobian
            slope -= jacobian.T @ trusted @ off
        step = np.linalg.solve(information, slope)
        rotation = Rotation.from_rotvec(step).as_matrix() @ rotation
        if np.linalg.norm(step) < 1e-10:
            break
    offs = [rotation @ s.in_sensor - s.in_link for s in sights]
    sizes = tuple(float(np.sqrt(float(o @ w @ o))) for o, w in zip(offs, weights, strict=True))
    excess = sum(min(size, HUBER) ** 2 for size in sizes) / max(2 * len(sights) - 3, 1)
    return SolvedMount(
        rotation,
        np.asarray(np.linalg.inv(information) * max(1.0, excess), dtype=np.float64),
        tuple(float(np.linalg.norm(o)) for o in offs),
        sizes,
    )


def _start(sights: Sequence[Sight], nominal: FloatArray) -> FloatArray:
    """Least squares with one number for each sight's weight, by the singular value decomposition (Markley 1988)."""
    profile = nominal / PRIOR_STD_RAD**2
    for sight in sights:
        variance = float(np.trace(sight.own + sight.posture)) / 2.0
        profile = profile + np.outer(sight.in_link, sight.in_sensor) / variance
    left, _, right = np.linalg.svd(profile)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _covariances(sights: Sequence[Sight]) -> list[FloatArray]:
    """Of each sight; the common part of postures that repeat a direction does not average out."""
    found = []
    for sight in sights:
        alike = sum(1 for o in sights if o.kind == sight.kind and o.in_link @ sight.in_link > ALIKE)
        # A unit vector gives no information along itself: it changes there to second order only.
        along = np.outer(sight.in_link, sight.in_link) * float(np.trace(sight.own + sight.posture))
        found.append(sight.own + sight.posture * (1.0 + SHARED * (alike - 1)) + along)
    return found


def _cross(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
