"""Joint trajectories in continuous time: what a simulation is driven by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline

from oarlock.errors import DataError

_DEGREE = 5
_MIN_KNOTS = _DEGREE + 1


def _finite(values: ArrayLike, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise DataError(f"motion: {name} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DataError(f"motion: {name}{list(index)} is {array[index]}; give a finite value for every knot")
    array.flags.writeable = False
    return array


def _check_times(time_s: NDArray[np.float64]) -> None:
    if time_s.size < _MIN_KNOTS:
        raise DataError(f"motion: {time_s.size} knots, a quintic spline needs at least {_MIN_KNOTS}")
    steps = np.diff(time_s)
    if steps.min() <= 0.0:
        at = int(np.argmin(steps))
        raise DataError(
            f"motion: time_s must increase; knot {at + 1} is at {time_s[at + 1]:.6f} s after "
            f"{time_s[at]:.6f} s. Sort the knots and drop repeated ones"
        )


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint values at knots, joined by quintic splines (continuous fourth derivative).

    Args:
        joint_names: names of the columns of ``q``, in the order of the model's joints.
        time_s: (K,) knot times, s, increasing, at least 6.
        q: (K, n_joints) hinges in rad, slides in m.
        base_acceleration_m_s2: (K, 3) coordinate acceleration of the root's origin, in root axes, without
            gravity; None for a root at rest or in uniform motion.

    Raises:
        DataError: wrong shape, values that are not finite, or times that do not increase.
    """

    joint_names: tuple[str, ...]
    time_s: NDArray[np.float64]
    q: NDArray[np.float64]
    base_acceleration_m_s2: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        if len(set(self.joint_names)) != len(self.joint_names):
            raise DataError(f"motion: joint_names repeat: {', '.join(self.joint_names)}")
        knots = np.size(self.time_s)
        object.__setattr__(self, "time_s", _finite(self.time_s, "time_s", (knots,)))
        _check_times(self.time_s)
        object.__setattr__(self, "q", _finite(self.q, "q", (knots, len(self.joint_names))))
        if self.base_acceleration_m_s2 is not None:
            base = _finite(self.base_acceleration_m_s2, "base_acceleration_m_s2", (knots, 3))
            object.__setattr__(self, "base_acceleration_m_s2", base)

    @property
    def start_s(self) -> float:
        """Time of the first knot, s."""
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last knot, s."""
        return float(self.time_s[-1])

    def at(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Joint values q (..., n_joints) at ``time_s`` (...), s.

        Raises:
            DataError: a time further than one knot interval outside the motion.
        """
        return np.asarray(self._q_spline(self._inside(time_s)), dtype=np.float64)

    def derivatives(
        self, time_s: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """(q, qd, qdd), each (..., n_joints), in rad or m per s and s2, at ``time_s`` (...).

        Raises:
            DataError: a time further than one knot interval outside the motion.
        """
        time = self._inside(time_s)
        q, qd, qdd = (np.asarray(self._q_spline(time, order), dtype=np.float64) for order in (0, 1, 2))
        return q, qd, qdd

    def base_acceleration_at(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Coordinate acceleration of the root's origin (..., 3), m/s2, root axes; zeros where there is none.

        Raises:
            DataError: a time further than one knot interval outside the motion.
        """
        time = self._inside(time_s)
        return np.asarray(self._base_spline(time), dtype=np.float64)

    def column(self, joint_name: str) -> NDArray[np.float64]:
        """Values (K,) of one joint at the knots.

        Raises:
            DataError: the motion has no such joint.
        """
        if joint_name not in self.joint_names:
            raise DataError(f"motion: no joint {joint_name!r}; it has {', '.join(self.joint_names)}")
        return self.q[:, self.joint_names.index(joint_name)]

    @cached_property
    def _q_spline(self) -> BSpline:
        return make_interp_spline(self.time_s, self.q, k=_DEGREE)

    @cached_property
    def _base_spline(self) -> BSpline:
        base = (
            np.zeros((self.time_s.size, 3))
            if self.base_acceleration_m_s2 is None
            else self.base_acceleration_m_s2
        )
        return make_interp_spline(self.time_s, base, k=_DEGREE)

    def _inside(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """One interval of slack lets a simulation take central differences at the very ends."""
        time = np.asarray(time_s, dtype=np.float64)
        first = self.start_s - (self.time_s[1] - self.time_s[0])
        last = self.end_s + (self.time_s[-1] - self.time_s[-2])
        outside = ~((time >= first) & (time <= last))
        if outside.any():
            raise DataError(
                f"motion: asked for {float(time[outside].flat[0]):.6f} s, but it lasts from {self.start_s:.6f} "
                f"to {self.end_s:.6f} s. Make the motion longer or ask inside it"
            )
        return time
