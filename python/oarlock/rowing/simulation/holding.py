"""Checks that the hands of a simulated piece stay on the handles; errors name the hand and the time in the stroke."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.simulation.grip import ARM_JOINTS, SIDES, GripSolver
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

CLOSURE_TOLERANCE_M = 1e-6
CLOSURE_TOLERANCE_AXIS = 1e-6
_LARGEST_SHOULDER_ROTATION_RAD = np.radians(75.0)


@dataclass(frozen=True, eq=False)
class Holding:
    """Both hands through a piece.

    ``activity`` heads the errors, ``sides`` names the hands in them by `r` and `l`, ``what_to_try`` ends them.
    """

    solver: GripSolver
    timing: StrokeTiming
    activity: str
    sides: Mapping[str, str]
    what_to_try: str

    def solve(self, q: Floats, preferred: Floats) -> Floats:
        """Joints q (K, n_joints) with hands on the handles and arms nearest to ``preferred`` (K, 2, 7).

        Raises:
            DataError: out of reach, no posture holds, or one that no shoulder or elbow should take.
        """
        self._check_reach(q)
        q = self.solver.solve(self.timing.time_s, q, preferred)
        self._check_grip(q, preferred)
        self._check_branch(q)
        return q

    def closure_everywhere(self, motion: Motion) -> tuple[float, float]:
        """Largest distance hand to handle, m, and largest difference of their z axes, at knots and midway.

        Raises:
            DataError: a hand leaves the handle between knots.
        """
        middles = 0.5 * (motion.time_s[1:] + motion.time_s[:-1])
        between = self.solver.closure(motion.at(middles))
        distance, axis = (
            float(max(a.max(), b.max())) for a, b in zip(self.solver.closure(motion.q), between, strict=True)
        )
        if distance > CLOSURE_TOLERANCE_M or axis > CLOSURE_TOLERANCE_AXIS:
            knot, side = _worst(between[0])
            raise DataError(
                f"{self.activity}: between knots, at {middles[knot]:.3f} s, the {self._side(side)} hand leaves the "
                f"handle by {1e3 * distance:.4f} mm: the posture changes too fast there, as when the arm is almost "
                f"out of reach. {self.what_to_try}, or raise knots_hz"
            )
        return distance, axis

    def _side(self, side: int) -> str:
        return self.sides[SIDES[side]]

    def _where(self, knot: int) -> str:
        phase = float(self.timing.phase[knot]) % 1.0
        part = (
            f"{200.0 * phase:.0f} % of the drive"
            if phase < 0.5
            else f"{200.0 * phase - 100.0:.0f} % of the recovery"
        )
        return f"at {part} ({self.timing.time_s[knot]:.3f} s)"

    def _check_reach(self, q: Floats) -> None:
        excess = self.solver.excess_reach(q)
        if excess.max() > 0.0:
            knot, side = _worst(excess)
            raise DataError(
                f"{self.activity}: the {self._side(side)} handle is {1e3 * excess[knot, side]:.1f} mm beyond the "
                f"stretched arm {self._where(knot)}. {self.what_to_try}"
            )

    def _check_grip(self, q: Floats, preferred: Floats) -> None:
        distance, axis = self.solver.closure(q)
        missed = np.maximum(distance / CLOSURE_TOLERANCE_M, axis / CLOSURE_TOLERANCE_AXIS)
        if missed.max() < 1.0:
            return
        open_knots = np.flatnonzero(~(missed < 1.0).all(axis=1))
        miss = self.solver.nearest_miss(q[open_knots], preferred[open_knots])
        knot, side = _worst(miss)
        where = self._where(int(open_knots[knot]))
        if miss[knot, side] < CLOSURE_TOLERANCE_M:
            raise DataError(
                f"{self.activity}: no arm posture near a rower's usual one reaches the handles {where}. "
                f"{self.what_to_try}"
            )
        raise DataError(
            f"{self.activity}: the {self._side(side)} hand misses the handle by {1e3 * miss[knot, side]:.1f} mm "
            f"{where} with the hand along the handle. {self.what_to_try}"
        )

    def _check_branch(self, q: Floats) -> None:
        rotation = np.abs(q[:, self.solver.columns[:, ARM_JOINTS.index("shoulder_rotation")]])
        elbow = q[:, self.solver.columns[:, ARM_JOINTS.index("elbow_flexion")]]
        if rotation.max() > _LARGEST_SHOULDER_ROTATION_RAD:
            knot, side = _worst(rotation)
            raise DataError(
                f"{self.activity}: the {self._side(side)} shoulder turns {np.degrees(rotation[knot, side]):.0f} deg "
                f"{self._where(knot)}; near 90 deg its angles are singular. {self.what_to_try}"
            )
        if elbow.min() < 0.0:
            knot, side = _worst(-elbow)
            raise DataError(
                f"{self.activity}: the {self._side(side)} elbow over-extends by "
                f"{-np.degrees(elbow[knot, side]):.1f} deg {self._where(knot)}. {self.what_to_try}"
            )


def _worst(values: Floats) -> tuple[int, int]:
    knot, side = np.unravel_index(int(np.argmax(np.nan_to_num(values, nan=np.inf))), values.shape)
    return int(knot), int(side)
