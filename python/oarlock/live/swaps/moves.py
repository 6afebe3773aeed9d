"""Short movements as a few numbers, and the readings that a body gives along them; many at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.rotation import (
    matrix_from_quat,
    quat_from_rotvec,
    quat_inverse,
    quat_product,
    rotvec_from_quat,
)
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model

ORDER = 4
"""Numbers of a coordinate: value, rate, acceleration and jerk in the middle."""
WIDER = (4.0, 6.0, 6.0)
"""A movement may begin anywhere and in full motion: factors on the start of the model's process."""
INPUT_STDS = (0.5, 2.0, 15.0)
"""Of an input joint, which has no process; rad or m, and by s."""
JERK_PER_S = 12.0
"""Standard deviation of the jerk, of that of the acceleration."""
BASE_STD_M_S2, BASE_SLOPE_M_S3 = 3.0, 20.0


@dataclass(frozen=True)
class PredictedReadings:
    """What a body's sensors read along movements, and how that depends on the movements' numbers.

    Args:
        values: (movements, times, rows).
        slopes: (movements, times, rows, numbers).
        q: (movements, times, coordinates).
    """

    values: Floats
    slopes: Floats
    q: Floats


@dataclass
class Moves:
    """Movements of a body around the middle of a window.

    Args:
        model: of the body.
        time_s: of the readings, s from the middle.
        rows: which of the model's measurements are computed.
    """

    model: Model
    time_s: Floats
    rows: Floats
    rest: Floats = field(init=False)
    """(coordinates,) the posture that is expected if nothing is known."""
    stds: Floats = field(init=False)
    """(numbers,) standard deviations of a movement's numbers from rest."""

    def __post_init__(self) -> None:
        described = self.model.describe()
        self._balls = [i for i, name in enumerate(self.model.coordinate_names) if name.endswith(".rx")]
        rest, stds = [], []
        for joint in described.joints:
            own = () if joint.process is None else joint.process.start_std
            scaled = [w * s for w, s in zip(WIDER, own, strict=False)]
            scaled += INPUT_STDS[len(scaled) :]
            first = np.ravel(joint.rest)
            for k in range(len(joint.coordinates)):
                rest.append(float(first[k]) if len(first) > k else 0.0)
                stds.append([*scaled, JERK_PER_S * scaled[-1]])
        self.rest = np.array(rest)
        bases = described.base_acceleration
        self._axes = np.array([base.axis for base in bases], dtype=float).reshape(-1, 3)
        base = [[BASE_STD_M_S2, BASE_SLOPE_M_S3]] * len(bases)
        self.stds = np.concatenate([np.array(stds).T.ravel(), np.array(base).T.ravel()])
        t = self.time_s
        self._value = np.stack([np.ones_like(t), t, t**2 / 2.0, t**3 / 6.0])
        self._rate = np.stack([np.zeros_like(t), np.ones_like(t), t, t**2 / 2.0])
        self._change = np.stack([np.zeros_like(t), np.zeros_like(t), np.ones_like(t), t])

    def readings(self, posture: Floats, numbers: Floats) -> PredictedReadings:
        """Readings of movements.

        Args:
            posture: (movements, coordinates) in the middle.
            numbers: (movements, numbers); the first of each coordinate is 0, because `posture` has it.
        """
        count, n = posture.shape
        parts = numbers[:, : ORDER * n].reshape(count, ORDER, n)
        q = posture[:, None] + np.einsum("ot,mon->mtn", self._value, parts)
        qd, qdd = (np.einsum("ot,mon->mtn", one, parts) for one in (self._rate, self._change))
        turned = self._turned(q, posture)
        force = numbers[:, ORDER * n :].reshape(count, 2, -1)
        base = _AcceleratingRoot.of(force[:, 0, None] + force[:, 1, None] * self.time_s[:, None], self._axes)
        values = self.model.predict_measurements(q, qd, qdd, base)[..., self.rows]
        by = self.model.measurement_jacobian(q, qd, qdd, base)
        by_q = by.by_q[..., self.rows, :]
        for first, back in turned.items():
            by_q[..., first : first + 3] = by_q[..., first : first + 3] @ back
        slopes = (
            np.einsum("ot,mtrn->mtron", self._value, by_q)
            + np.einsum("ot,mtrn->mtron", self._rate, by.by_qd[..., self.rows, :])
            + np.einsum("ot,mtrn->mtron", self._change, by.by_qdd[..., self.rows, :])
        ).reshape(*values.shape, ORDER * n)
        return PredictedReadings(
            values, np.concatenate([slopes, *self._by_base(q, qd, qdd, base, values)], axis=-1), q
        )

    def moved(self, posture: Floats, step: Floats) -> Floats:
        """The posture after a step of the first numbers, (movements, coordinates)."""
        found = posture + step
        for first in self._balls:
            own = slice(first, first + 3)
            found[:, own] = rotvec_from_quat(
                quat_product(quat_from_rotvec(posture[:, own]), quat_from_rotvec(step[:, own]))
            )
        return found

    def _turned(self, q: Floats, posture: Floats) -> dict[int, Floats]:
        """Makes rotation vectors of balls of their turns since the middle, and gives how turns there turn them."""
        found = {}
        for first in self._balls:
            own = slice(first, first + 3)
            since = quat_from_rotvec(q[..., own] - posture[:, None, own])
            q[..., own] = rotvec_from_quat(quat_product(quat_from_rotvec(posture[:, None, own]), since))
            found[first] = matrix_from_quat(quat_inverse(since))
        return found

    def _by_base(
        self, q: Floats, qd: Floats, qdd: Floats, base: _AcceleratingRoot, values: Floats
    ) -> list[Floats]:
        """How readings change with the base's accelerations: they are linear in these."""
        if not len(self._axes):
            return []
        changes = []
        for axis in self._axes:
            more = _AcceleratingRoot(base.acceleration_m_s2 + axis)
            changed = self.model.predict_measurements(q, qd, qdd, more)[..., self.rows]
            changes.append(changed - values)
        by = np.stack(changes, axis=-1)
        return [by, by * self.time_s[:, None, None]]


class _AcceleratingRoot:
    """A root that accelerates and does not turn."""

    def __init__(self, acceleration_m_s2: Floats) -> None:
        self.acceleration_m_s2 = acceleration_m_s2
        self.rotation = np.broadcast_to(np.eye(3), (*acceleration_m_s2.shape[:-1], 3, 3)).copy()
        self.angular_velocity_rad_s = np.zeros_like(acceleration_m_s2)
        self.angular_acceleration_rad_s2 = np.zeros_like(acceleration_m_s2)

    @classmethod
    def of(cls, along: Floats, axes: Floats) -> _AcceleratingRoot:
        return cls(along @ axes)
