"""Solves for a mount from directions in sensor and link: Wahba's problem (1965) with full covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.robust_fit import huber, robust_fit
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Floats

PRIOR_STD_RAD = float(np.radians(60.0))
"""Weight of the nominal mount: it only decides directions that nothing else determines."""
SHARED = 0.5
"""Share of the variance that postures have in common in which a direction is the same: people repeat their errors."""
ALIKE = float(np.cos(np.radians(15.0)))
HUBER = 2.5


@dataclass(frozen=True, eq=False)
class DirectionPair:
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
    in_sensor: Floats
    in_link: Floats
    own: Floats
    posture: Floats


@dataclass(frozen=True, eq=False)
class SolvedMount:
    """A rotation.

    Args:
        link_from_sensor: (3, 3).
        covariance: (3, 3) rad2, of small turns about the link's axes.
        off_rad: residual angle of each sight, rad.
        off_stds: the same in standard deviations.
    """

    link_from_sensor: Floats
    covariance: Floats
    off_rad: tuple[float, ...]
    off_stds: tuple[float, ...]

    @property
    def std_rad(self) -> Floats:
        """(3,) about the link's axes."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def worst_std_rad(self) -> float:
        """About the axis that is known least."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


def isotropic(direction: Floats, std_rad: float) -> Floats:
    """(3, 3) covariance of a unit vector that is off by `std_rad` in each of two directions."""
    return std_rad**2 * (np.eye(3) - np.outer(direction, direction))


def solved_mount(sights: Sequence[DirectionPair], nominal: Floats) -> SolvedMount:
    """The most likely mount. Undetermined directions keep the nominal mount and have a large covariance."""
    in_sensor = np.reshape([s.in_sensor for s in sights], (-1, 3))
    in_link = np.reshape([s.in_link for s in sights], (-1, 3))
    whitened = np.reshape([np.linalg.cholesky(np.linalg.inv(c)).T for c in _covariances(sights)], (-1, 3, 3))

    def linearised(rotation: Floats) -> tuple[Floats, Floats]:
        seen = in_sensor @ rotation.T
        slopes = whitened @ np.cross(np.eye(3), -seen[:, None])
        return np.einsum("nij,nj->ni", whitened, seen - in_link).reshape(-1), slopes.reshape(-1, 3)

    rotation, covariance = robust_fit(
        linearised,
        _start(sights, nominal),
        huber(HUBER, rows=3),
        moved=lambda before, step: matrix_from_quat(quat_from_rotvec(step)) @ before,
        damping=PRIOR_STD_RAD**-2,
        converged=1e-10,
    )
    stds = np.linalg.norm(linearised(rotation)[0].reshape(-1, 3), axis=1)
    excess = float((np.minimum(stds, HUBER) ** 2).sum()) / max(2 * len(sights) - 3, 1)
    off_rad = np.linalg.norm(in_sensor @ rotation.T - in_link, axis=1)
    return SolvedMount(
        rotation, covariance * max(1.0, excess), tuple(map(float, off_rad)), tuple(map(float, stds))
    )


def _start(sights: Sequence[DirectionPair], nominal: Floats) -> Floats:
    """Wahba's problem with one variance for each sight, and the nominal mount as three more sights.

    Source: F. L. Markley 1988, "Attitude determination using vector observations and the singular value
    decomposition", J. Astronautical Sciences 36(3).
    """
    weights = [2.0 / float(np.trace(s.own + s.posture)) for s in sights]
    in_link = [*nominal.T, *(s.in_link for s in sights)]
    in_sensor = [*np.eye(3), *(s.in_sensor for s in sights)]
    each = np.array([PRIOR_STD_RAD**-2] * 3 + weights)
    left, _, right = np.linalg.svd((np.array(in_link).T * each) @ np.array(in_sensor))
    left[:, 2] *= np.linalg.det(left) * np.linalg.det(right)  # a rotation, no reflection
    return np.asarray(left @ right)


def _covariances(sights: Sequence[DirectionPair]) -> list[Floats]:
    """Of each sight; the common part of postures that repeat a direction does not average out."""
    found = []
    for sight in sights:
        alike = sum(1 for o in sights if o.kind == sight.kind and o.in_link @ sight.in_link > ALIKE)
        # A unit vector gives no information along itself: it changes there to second order only.
        along = np.outer(sight.in_link, sight.in_link) * float(np.trace(sight.own + sight.posture))
        found.append(sight.own + sight.posture * (1.0 + SHARED * (alike - 1)) + along)
    return found
