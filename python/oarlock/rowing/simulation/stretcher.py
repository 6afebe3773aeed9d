"""Adjusts the foot stretcher of a simulated rower so that the arms reach the handles in the whole stroke."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oarlock.rowing.simulation.arms import WEIGHTS
from oarlock.rowing.simulation.grip import SIDES, ArmKinematics, GripSolver
from oarlock.rowing.simulation.stroke_shape import StrokeShape, body_and_oars
from oarlock.rowing.simulation.timing import stroke_timing
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

SPARE_REACH_M = 0.06
"""Straight arms would pass the handles by this much: bent wrists and variation need it."""
_PERIOD_S = 2.0
_SAMPLES = 201
_LARGEST_MOVE_M = 0.15
_ROUNDS = 12


def adjusted_stretcher(model: ArmKinematics, shape: StrokeShape | None = None) -> StrokeShape:
    """The stroke with its seat travel shifted until both arms have ``SPARE_REACH_M`` left in the whole stroke.

    Raises:
        DataError: moving the seat by 150 mm is not enough.
    """
    wanted = StrokeShape() if shape is None else shape
    solver = GripSolver(model, WEIGHTS)
    moved = 0.0
    for _ in range(_ROUNDS):
        fitted = replace(wanted, seat_m=(wanted.seat_m[0] + moved, wanted.seat_m[1] + moved))
        lacking = _lacking_reach(model, solver, fitted)
        if lacking.max() <= 0.0:
            return fitted
        # The arm is never quite along the keel, so that this falls a little short and is repeated.
        moved += float(lacking.max()) + 1e-3
        if moved > _LARGEST_MOVE_M:
            break
    side = {"r": "right (port oar)", "l": "left (starboard oar)"}[SIDES[int(np.argmax(lacking))]]
    raise DataError(
        f"stretcher: {1e3 * moved:.0f} mm toward the stern is not enough, the {side} arm still lacks "
        f"{1e3 * float(lacking.max()):.0f} mm. Try a smaller catch angle (phi_rad), or check lengths, pins and inboard"
    )


def _lacking_reach(model: ArmKinematics, solver: GripSolver, shape: StrokeShape) -> Floats:
    """By how much (2,) each arm's spare reach falls short of the wanted one in its worst place, m."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, _PERIOD_S, _SAMPLES)
    timing = stroke_timing(time, 60.0 / _PERIOD_S, None, 0.0, rng)
    q = np.zeros((time.size, len(model.joint_names)))
    for name, value in body_and_oars(shape, timing, 0.0, rng).items():
        q[:, list(model.joint_names).index(name)] = value
    return np.asarray(solver.excess_reach(q).max(axis=0) + SPARE_REACH_M, dtype=np.float64)
