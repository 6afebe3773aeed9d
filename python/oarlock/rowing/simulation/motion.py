"""Simulates a plausible sculling motion for any model with the sculler's joints and frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import ParamSpec

import numpy as np

from oarlock.rowing.simulation.arms import WEIGHTS, preferred_arms
from oarlock.rowing.simulation.boat import Boat, HullMotion, hull_motion
from oarlock.rowing.simulation.grip import ARM_JOINTS, SIDES, ArmKinematics, GripSolver
from oarlock.rowing.simulation.holding import Holding
from oarlock.rowing.simulation.stroke_shape import StrokeShape, body_and_oars
from oarlock.rowing.simulation.timing import StrokeTiming, stroke_timing
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.memory_limit import check_memory

Parameters = ParamSpec("Parameters")

KNOT_BYTES = 5000.0
"""Memory for each knot of a simulated sculler's motion and recording, measured between 40 and 1240 s."""
_SIDE_NAMES = {"r": "right (port oar)", "l": "left (starboard oar)"}
_MODEL_OF = {"sculling": "sculler", "sweep": "sweep", "ergometer": "ergometer"}
_WHAT_TO_TRY = (
    "Move the stretcher (oarlock.rowing.adjusted_stretcher), try a smaller catch angle (phi_rad) or more "
    "forward lean, or check the lengths of arms and trunk, the pins and the inboard"
)


@dataclass(frozen=True, eq=False)
class Piece:
    """A simulated piece: the motion, its strokes, the hull's motion, and the closure residuals of the hands.

    ``closure_m`` and ``closure_axis`` are the largest distance hand to handle, m, and the largest difference
    of their z axes, over the knots and midway between them. ``hull`` is None without a boat.
    """

    motion: Motion
    timing: StrokeTiming
    hull: HullMotion | None
    closure_m: float
    closure_axis: float


def row_piece(
    model: ArmKinematics,
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    *,
    drive_ratio: float | None = None,
    shape: StrokeShape | None = None,
    last_third: StrokeShape | None = None,
    variation: float = 1.0,
    boat: Boat | None = None,
    surge: bool = True,
    start_s: float = 0.0,
    seed: int = 0,
    knots_hz: float = 250.0,
) -> Piece:
    """Simulate sculling with strokes, boat speed and closure residuals; the hands are on the handles to 1e-6 m.

    Args:
        model: the sculler, or a model with the same joint and frame names.
        duration_s: length, s.
        rate_spm: strokes per minute; (20, 34) goes evenly from 20 to 34.
        drive_ratio: drive over cycle; None: 0.36 at 20 spm to 0.45 at 34.
        shape: seat travel, lean, oar angles, asymmetry and timing; None: a good sculler's.
        last_third: seat travel, lean and oar angles in the last third of the piece, of a rower who tires; None: as
            before.
        variation: 1 = the stroke-to-stroke variation of a good sculler, 0 = every stroke the same.
        boat: masses, drag and speed; None: a single scull.
        surge: False leaves the boat in uniform motion (``base_acceleration_m_s2`` is None).
        start_s: time of the first knot, which is a catch, s.
        seed: of the variation.
        knots_hz: knots of the splines per second.

    Raises:
        DataError: the hands cannot hold the handles somewhere, or an argument is out of range.
    """
    shape = StrokeShape() if shape is None else shape
    time = knots(duration_s, start_s, knots_hz, variation)
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time, rate_spm, drive_ratio, variation, streams[0])
    fixed = body_and_oars(shape, timing, variation, streams[1], last_third)
    preferred = preferred_arms(timing, shape.asymmetry, variation, streams[2])
    check_joints(model, fixed, "sculling")
    holding = Holding(GripSolver(model, WEIGHTS), timing, "sculling", _SIDE_NAMES, _WHAT_TO_TRY)
    return held_piece(model, fixed, preferred, holding, Boat() if boat is None else boat, surge)


def motion_of(piece: Callable[Parameters, Piece], name: str, about: str) -> Callable[Parameters, Motion]:
    """The function `name` with the arguments of `piece` that returns the motion alone."""

    @wraps(piece)
    def motion(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Motion:
        return piece(*args, **kwargs).motion

    motion.__name__ = motion.__qualname__ = name
    motion.__doc__ = f"{about} as joint trajectories; arguments and errors are those of `{piece.__name__}`."
    return motion


sculling = motion_of(row_piece, "sculling", "Sculling")


def held_piece(
    model: ArmKinematics,
    fixed: Mapping[str, Floats],
    preferred: Floats,
    holding: Holding,
    boat: Boat,
    surge: bool,
) -> Piece:
    """A piece from the joints that are ``fixed`` (K,) by name, with arms near ``preferred`` (K, 2, 7)."""
    timing = holding.timing
    q = np.zeros((timing.time_s.size, len(model.joint_names)))
    for name, value in fixed.items():
        q[:, list(model.joint_names).index(name)] = value
    q = holding.solve(q, preferred)
    hull = hull_motion(model, q, timing, boat) if surge else None
    motion = Motion(
        tuple(model.joint_names),
        timing.time_s,
        q,
        None if hull is None else np.outer(hull.acceleration_m_s2, (0.0, 0.0, 1.0)),
    )
    return Piece(motion, timing, hull, *holding.closure_everywhere(motion))


def knots(duration_s: float, start_s: float, knots_hz: float, variation: float) -> Floats:
    """Times (K,) of the splines' knots, s; refuses what no piece can have."""
    if not (np.isfinite([duration_s, start_s, knots_hz]).all() and duration_s > 0.0 and knots_hz >= 50.0):
        raise DataError(
            f"rowing: duration_s {duration_s}, start_s {start_s}, knots_hz {knots_hz}; the duration must be "
            "positive and the knots at least 50 a second"
        )
    if not 0.0 <= variation <= 5.0:
        raise DataError(f"rowing: variation is {variation}; give 0 (every stroke the same) to 5, 1 is usual")
    check_memory(
        KNOT_BYTES * duration_s * knots_hz,
        f"rowing: duration_s = {duration_s:g}",
        "Simulate a shorter piece, or several.",
    )
    return start_s + np.linspace(0.0, duration_s, max(6, int(np.ceil(duration_s * knots_hz)) + 1))


def check_joints(model: ArmKinematics, needed: Iterable[str], activity: str) -> None:
    """Refuses a model that lacks a joint, of the arms or another, before its hands are looked for."""
    names = list(model.joint_names)
    for name in (*needed, *(f"{side}_{joint}" for side in SIDES for joint in ARM_JOINTS)):
        if name not in names:
            raise DataError(
                f"{activity}: the model has no joint {name!r}; it has {', '.join(names)}. "
                f"Use the model '{_MODEL_OF[activity]}' or one with the same joint names"
            )
