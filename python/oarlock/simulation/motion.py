"""`Motion`: joint trajectories in continuous time, the input of `simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from oarlock.model.coordinates import POSITION, ROTATION, joint_columns, parts
from oarlock.model.rotation import body_rates, continuous_quat, quat_from_rotvec, rotvec_from_quat, unit_quats
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_DEGREE = 5
_MIN_KNOTS = _DEGREE + 1
_WIDEST_TURN_RAD = 0.5 * np.pi
"""Largest rotation of a ball joint between two knots, rad; beyond it the direction of rotation is ambiguous."""


def _finite(values: ArrayLike, name: str, shape: tuple[int, ...]) -> Floats:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise DataError(f"motion: {name} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DataError(f"motion: {name}{list(index)} is {array[index]}; give a finite value for every knot")
    array.flags.writeable = False
    return array


def _check_times(time_s: Floats) -> None:
    if time_s.size < _MIN_KNOTS:
        raise DataError(f"motion: {time_s.size} knots, a quintic spline needs at least {_MIN_KNOTS}")
    steps = np.diff(time_s)
    if steps.min() <= 0.0:
        at = int(np.argmin(steps))
        raise DataError(
            f"motion: time_s must increase; knot {at + 1} is at {time_s[at + 1]:.6f} s after "
            f"{time_s[at]:.6f} s. Sort the knots and drop repeated ones"
        )


def _check_turns(joint: str, time_s: Floats, rotvec_rad: Floats) -> None:
    quat = quat_from_rotvec(rotvec_rad)
    turns = 2.0 * np.arccos(np.clip(np.abs(np.sum(quat[1:] * quat[:-1], axis=1)), 0.0, 1.0))
    worst = int(np.argmax(turns))
    if turns[worst] > _WIDEST_TURN_RAD:
        raise DataError(
            f'motion: ball joint "{joint}" rotates by {np.degrees(turns[worst]):.0f} deg from {time_s[worst]:.6f} to '
            f"{time_s[worst + 1]:.6f} s, so the direction is ambiguous. Use more knots: at most 90 deg apart"
        )


def _as_coordinates(joint: str, values: Floats) -> tuple[list[str], Floats]:
    """Names and (K, ...) values of a joint's coordinates."""
    if values.ndim == 1:
        return [joint], values[:, None]
    if values.ndim != 2 or values.shape[1] not in (3, 4, 6, 7):
        raise DataError(
            f'motion: joint "{joint}" has values of shape {values.shape}; expected (K,) for a hinge or slide, (K, 4) '
            "quat_wxyz or (K, 3) rotation vectors for a ball joint, (K, 7) or (K, 6) for a free one, position first"
        )
    free = values.shape[1] > 4
    place, turn = values[:, : 3 * free], values[:, 3 * free :]
    if turn.shape[1] == 4:
        turn = rotvec_from_quat(unit_quats(turn, f'motion: quaternions of joint "{joint}"'))
    labels = POSITION * free + ROTATION
    return [f"{joint}.{label}" for label in labels], np.hstack([place, turn])


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint values at knots, interpolated by quintic splines (continuous fourth derivative).

    The rotation of a ball or free joint is given as a rotation vector. Its splines interpolate the unit quaternions of
    the knots, with continuous signs, and are normalised. So the trajectory passes through every knot, is smooth in all
    postures and full turns, and takes the shorter way between knots.

    Args:
        joint_names: names of the columns of ``q``: joints, or coordinates where a joint has several (`hip.rx`,
            `hip.ry`, `hip.rz`), in any order. They are stored as ``coordinate_names``; ``joint_names`` then has the
            joints.
        time_s: (K,) knot times, s, increasing, at least 6.
        q: (K, n_coordinates) hinges and rotation vectors in rad, slides and positions in m.
        base_acceleration_m_s2: (K, 3) coordinate acceleration of the root's origin, in root axes, without
            gravity; None for a root at rest or in uniform motion.

    Raises:
        DataError: wrong shape, values that are not finite, times that do not increase, or a ball joint that lacks a
            coordinate or rotates by more than 90 deg between two knots.
    """

    joint_names: tuple[str, ...]
    time_s: Floats
    q: Floats
    base_acceleration_m_s2: Floats | None = None
    coordinate_names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = tuple(self.joint_names)
        if len(set(names)) != len(names):
            raise DataError(f"motion: joint_names repeat: {', '.join(names)}")
        object.__setattr__(self, "coordinate_names", names)
        object.__setattr__(self, "joint_names", tuple(joint_columns(names)))
        knots = np.size(self.time_s)
        object.__setattr__(self, "time_s", _finite(self.time_s, "time_s", (knots,)))
        _check_times(self.time_s)
        object.__setattr__(self, "q", _finite(self.q, "q", (knots, len(names))))
        for joint, columns in self._rotations.items():
            _check_turns(joint, self.time_s, self.q[:, columns])
        if self.base_acceleration_m_s2 is not None:
            base = _finite(self.base_acceleration_m_s2, "base_acceleration_m_s2", (knots, 3))
            object.__setattr__(self, "base_acceleration_m_s2", base)

    @classmethod
    def from_joints(
        cls,
        time_s: ArrayLike,
        joints: Mapping[str, ArrayLike],
        base_acceleration_m_s2: ArrayLike | None = None,
    ) -> Motion:
        """A motion of joints by name.

        Args:
            time_s: (K,) knot times, s, increasing, at least 6.
            joints: values of each joint at the knots: (K,) for a hinge (rad) or slide (m); for a ball joint (K, 4)
                quat_wxyz or (K, 3) rotation vectors, rad; for a free joint the position x, y, z (m), followed by either
                of these, (K, 7) or (K, 6).
            base_acceleration_m_s2: as for `Motion`.

        Raises:
            DataError: as `Motion`; or a wrong shape, or quaternions that are not unit.
        """
        names: list[str] = []
        columns: list[Floats] = []
        for joint, values in joints.items():
            own, given = _as_coordinates(joint, np.asarray(values, dtype=np.float64))
            names += own
            columns.append(given)
        if not columns:
            raise DataError("motion: no joint is given")
        if len({len(given) for given in columns}) > 1:
            counts = ", ".join(f"{name}: {len(given)}" for name, given in zip(joints, columns, strict=True))
            raise DataError(f"motion: the joints have different numbers of knots ({counts})")
        time = np.asarray(time_s, dtype=np.float64)
        base = (
            None if base_acceleration_m_s2 is None else np.asarray(base_acceleration_m_s2, dtype=np.float64)
        )
        return cls(tuple(names), time, np.hstack(columns), base)

    @property
    def start_s(self) -> float:
        """Time of the first knot, s."""
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last knot, s."""
        return float(self.time_s[-1])

    def at(self, time_s: ArrayLike) -> Floats:
        """Values q (..., n_coordinates) at ``time_s`` (...), s; rotation vectors are the shortest, at most pi long.

        Raises:
            DataError: a time more than one knot interval outside the motion.
        """
        time = self._inside(time_s)
        q = np.empty((*time.shape, len(self.coordinate_names)))
        q[..., self._scalars] = self._q_spline(time)
        for joint, columns in self._rotations.items():
            quat = self._quat_splines[joint](time)
            q[..., columns] = rotvec_from_quat(quat / np.linalg.norm(quat, axis=-1, keepdims=True))
        return q

    def derivatives(self, time_s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """(q, qd, qdd), each (..., n_coordinates), in rad or m per s and s2, at ``time_s`` (...).

        For a rotation qd is the angular velocity of the child relative to the parent, in the child's axes, and qdd its
        derivative; both follow from the splines without finite differences.

        Raises:
            DataError: a time more than one knot interval outside the motion.
        """
        time = self._inside(time_s)
        q = self.at(time)
        qd, qdd = np.empty_like(q), np.empty_like(q)
        qd[..., self._scalars], qdd[..., self._scalars] = (self._q_spline(time, order) for order in (1, 2))
        for joint, columns in self._rotations.items():
            course = self._quat_splines[joint]
            qd[..., columns], qdd[..., columns] = body_rates(*(course(time, order) for order in (0, 1, 2)))
        return q, qd, qdd

    def base_acceleration_at(self, time_s: ArrayLike) -> Floats:
        """Coordinate acceleration of the root's origin (..., 3), m/s2, root axes; zeros if none is given.

        Raises:
            DataError: a time more than one knot interval outside the motion.
        """
        time = self._inside(time_s)
        return np.asarray(self._base_spline(time), dtype=np.float64)

    def column(self, joint_name: str) -> Floats:
        """Values (K,) of one hinge, slide or coordinate at the knots.

        Raises:
            DataError: the motion has no such column.
        """
        if joint_name not in self.coordinate_names:
            raise DataError(f"motion: no joint {joint_name!r}; it has {', '.join(self.coordinate_names)}")
        return self.q[:, self.coordinate_names.index(joint_name)]

    @cached_property
    def _rotations(self) -> dict[str, list[int]]:
        """Columns of the rotation vector of each ball and free joint."""
        return {
            part.joint: list(part.columns) for part in parts(self.coordinate_names) if part.kind == "rotation"
        }

    @cached_property
    def _scalars(self) -> list[int]:
        turning = {column for columns in self._rotations.values() for column in columns}
        return [column for column in range(len(self.coordinate_names)) if column not in turning]

    @cached_property
    def _q_spline(self) -> BSpline:
        return make_interp_spline(self.time_s, self.q[:, self._scalars], k=_DEGREE)

    @cached_property
    def _quat_splines(self) -> dict[str, BSpline]:
        quats = {
            joint: continuous_quat(quat_from_rotvec(self.q[:, columns]))
            for joint, columns in self._rotations.items()
        }
        return {joint: make_interp_spline(self.time_s, quat, k=_DEGREE) for joint, quat in quats.items()}

    @cached_property
    def _base_spline(self) -> BSpline:
        base = (
            np.zeros((self.time_s.size, 3))
            if self.base_acceleration_m_s2 is None
            else self.base_acceleration_m_s2
        )
        return make_interp_spline(self.time_s, base, k=_DEGREE)

    def _inside(self, time_s: ArrayLike) -> Floats:
        """Checks times. One knot interval beyond each end is allowed for central differences."""
        time = np.asarray(time_s, dtype=np.float64)
        first = self.start_s - (self.time_s[1] - self.time_s[0])
        last = self.end_s + (self.time_s[-1] - self.time_s[-2])
        outside = ~((time >= first) & (time <= last))
        if outside.any():
            raise DataError(
                f"motion: {float(time[outside].flat[0]):.6f} s was requested, but it lasts from {self.start_s:.6f} "
                f"to {self.end_s:.6f} s. Make the motion longer, or request a time inside it"
            )
        return time
