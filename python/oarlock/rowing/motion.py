"""A plausible sculling motion for any model with the sculler's joints and frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.errors import DataError
from oarlock.motion import Motion
from oarlock.rowing.arms import WEIGHTS, preferred_arms
from oarlock.rowing.boat import Boat, HullMotion, hull_motion
from oarlock.rowing.grip import ARM_JOINTS, SIDES, Body, GripSolver
from oarlock.rowing.stroke import StrokeShape, body_and_oars
from oarlock.rowing.timing import StrokeTiming, stroke_timing

Array = NDArray[np.float64]

CLOSURE_TOLERANCE_M = 1e-6
CLOSURE_TOLERANCE_AXIS = 1e-6
_LARGEST_SHOULDER_ROTATION_RAD = np.radians(75.0)
_SIDE_NAMES = {"r": "right (port oar)", "l": "left (starboard oar)"}
_WHAT_TO_TRY = (
    "Move the stretcher (oarlock.rowing.adjusted_stretcher), try a smaller catch angle (phi_rad) or more "
    "forward lean, or check the lengths of arms and trunk, the pins and the inboard"
)


@dataclass(frozen=True, eq=False)
class Piece:
    """A rowed piece: the motion, its strokes, the hull's motion, and how well the hands hold the handles.

    ``closure_m`` and ``closure_axis`` are the largest distance hand to handle, m, and the largest difference
    of their z axes, over the knots and midway between them. ``hull`` is None without a boat.
    """

    motion: Motion
    timing: StrokeTiming
    hull: HullMotion | None
    closure_m: float
    closure_axis: float


def sculling(
    model: Body,
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    *,
    drive_ratio: float | None = None,
    shape: StrokeShape | None = None,
    variation: float = 1.0,
    boat: Boat | None = None,
    surge: bool = True,
    start_s: float = 0.0,
    seed: int = 0,
    knots_hz: float = 250.0,
) -> Motion:
    """Sculling with a surging boat as joint trajectories; hands hold the handles to 1e-6 m.

    Args:
        model: the sculler, or a model with the same joint and frame names.
        duration_s: length, s.
        rate_spm: strokes per minute; (20, 34) goes evenly from 20 to 34.
        drive_ratio: drive over cycle; None: 0.36 at 20 spm to 0.45 at 34.
        shape: seat travel, lean, oar angles and asymmetry; None: a good sculler's.
        variation: 1 = the stroke-to-stroke variation of a good sculler, 0 = every stroke the same.
        boat: masses, drag and speed; None: a single scull.
        surge: False leaves the boat in uniform motion (``base_acceleration_m_s2`` is None).
        start_s: time of the first knot, which is a catch, s.
        seed: of the variation.
        knots_hz: knots of the splines per second.

    Raises:
        DataError: the hands cannot hold the handles somewhere, or an argument is out of range.
    """
    return row_piece(
        model,
        duration_s,
        rate_spm,
        drive_ratio=drive_ratio,
        shape=shape,
        variation=variation,
        boat=boat,
        surge=surge,
        start_s=start_s,
        seed=seed,
        knots_hz=knots_hz,
    ).motion


def row_piece(
    model: Body,
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    *,
    drive_ratio: float | None = None,
    shape: StrokeShape | None = None,
    variation: float = 1.0,
    boat: Boat | None = None,
    surge: bool = True,
    start_s: float = 0.0,
    seed: int = 0,
    knots_hz: float = 250.0,
) -> Piece:
    """As :func:`sculling`, with the strokes, the boat's speed and the closure residuals beside the motion."""
    shape = StrokeShape() if shape is None else shape
    time = _knots(duration_s, start_s, knots_hz)
    _check_variation(variation)
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time, rate_spm, drive_ratio, variation, streams[0])
    fixed = body_and_oars(shape, timing, variation, streams[1])
    q = np.zeros((time.size, len(model.joint_names)))
    for name, value in fixed.items():
        q[:, _column(model, name)] = value
    preferred = preferred_arms(timing, shape.asymmetry, variation, streams[2])
    solver = GripSolver(model, WEIGHTS)
    _check_reach(solver, q, timing)
    q = solver.solve(time, q, preferred)
    _check_grip(solver, q, preferred, timing)
    hull = hull_motion(model, q, timing, Boat() if boat is None else boat) if surge else None
    motion = Motion(tuple(model.joint_names), time, q, None if hull is None else _along_z(hull))
    return Piece(motion, timing, hull, *_closure_everywhere(solver, motion))


def _closure_everywhere(solver: GripSolver, motion: Motion) -> tuple[float, float]:
    middles = 0.5 * (motion.time_s[1:] + motion.time_s[:-1])
    between = solver.closure(motion.at(middles))
    distance, axis = (
        float(max(a.max(), b.max())) for a, b in zip(solver.closure(motion.q), between, strict=True)
    )
    if distance > CLOSURE_TOLERANCE_M or axis > CLOSURE_TOLERANCE_AXIS:
        knot, side = _worst(between[0])
        raise DataError(
            f"sculling: between knots, at {middles[knot]:.3f} s, the {_SIDE_NAMES[SIDES[side]]} hand leaves the "
            f"handle by {1e3 * distance:.4f} mm: the posture changes too fast there, as when the arm is almost "
            f"out of reach. {_WHAT_TO_TRY}, or raise knots_hz"
        )
    return distance, axis


def _knots(duration_s: float, start_s: float, knots_hz: float) -> Array:
    if not (np.isfinite([duration_s, start_s, knots_hz]).all() and duration_s > 0.0 and knots_hz >= 50.0):
        raise DataError(
            f"sculling: duration_s {duration_s}, start_s {start_s}, knots_hz {knots_hz}; the duration must be "
            "positive and the knots at least 50 a second"
        )
    return start_s + np.linspace(0.0, duration_s, max(6, int(np.ceil(duration_s * knots_hz)) + 1))


def _check_variation(variation: float) -> None:
    if not 0.0 <= variation <= 5.0:
        raise DataError(
            f"sculling: variation is {variation}; give 0 (every stroke the same) to 5, 1 is usual"
        )


def _column(model: Body, joint_name: str) -> int:
    names = list(model.joint_names)
    if joint_name not in names:
        raise DataError(
            f"sculling: the model has no joint {joint_name!r}; it has {', '.join(names)}. "
            "Use the model 'sculler' or one with the same joint names"
        )
    return names.index(joint_name)


def _along_z(hull: HullMotion) -> Array:
    zeros = np.zeros_like(hull.acceleration_m_s2)
    return np.stack([zeros, zeros, hull.acceleration_m_s2], axis=-1)


def _where(timing: StrokeTiming, knot: int) -> str:
    phase = float(timing.phase[knot]) % 1.0
    part = (
        f"{200.0 * phase:.0f} % of the drive"
        if phase < 0.5
        else f"{200.0 * phase - 100.0:.0f} % of the recovery"
    )
    return f"at {part} ({timing.time_s[knot]:.3f} s)"


def _worst(values: Array) -> tuple[int, int]:
    knot, side = np.unravel_index(int(np.argmax(np.nan_to_num(values, nan=np.inf))), values.shape)
    return int(knot), int(side)


def _check_reach(solver: GripSolver, q: Array, timing: StrokeTiming) -> None:
    excess = solver.excess_reach(q)
    if excess.max() > 0.0:
        knot, side = _worst(excess)
        raise DataError(
            f"sculling: the {_SIDE_NAMES[SIDES[side]]} handle is {1e3 * excess[knot, side]:.1f} mm beyond the "
            f"stretched arm {_where(timing, knot)}. {_WHAT_TO_TRY}"
        )


def _check_grip(solver: GripSolver, q: Array, preferred: Array, timing: StrokeTiming) -> None:
    distance, axis = solver.closure(q)
    missed = np.maximum(distance / CLOSURE_TOLERANCE_M, axis / CLOSURE_TOLERANCE_AXIS)
    if not missed.max() < 1.0:
        open_knots = np.flatnonzero(~(missed < 1.0).all(axis=1))
        miss = solver.nearest_miss(q[open_knots], preferred[open_knots])
        knot, side = _worst(miss)
        where = _where(timing, int(open_knots[knot]))
        if miss[knot, side] < CLOSURE_TOLERANCE_M:
            raise DataError(
                f"sculling: no arm posture near a sculler's usual one holds the handles {where}. {_WHAT_TO_TRY}"
            )
        raise DataError(
            f"sculling: the {_SIDE_NAMES[SIDES[side]]} hand misses the handle by {1e3 * miss[knot, side]:.1f} mm "
            f"{where} with the hand along the handle. {_WHAT_TO_TRY}"
        )
    _check_branch(solver, q, timing)


def _check_branch(solver: GripSolver, q: Array, timing: StrokeTiming) -> None:
    rotation = np.abs(q[:, solver.columns[:, ARM_JOINTS.index("shoulder_rotation")]])
    elbow = q[:, solver.columns[:, ARM_JOINTS.index("elbow_flexion")]]
    if rotation.max() > _LARGEST_SHOULDER_ROTATION_RAD:
        knot, side = _worst(rotation)
        raise DataError(
            f"sculling: the {_SIDE_NAMES[SIDES[side]]} shoulder turns {np.degrees(rotation[knot, side]):.0f} deg "
            f"{_where(timing, knot)}; near 90 deg its angles are singular. {_WHAT_TO_TRY}"
        )
    if elbow.min() < 0.0:
        knot, side = _worst(-elbow)
        raise DataError(
            f"sculling: the {_SIDE_NAMES[SIDES[side]]} elbow over-extends by "
            f"{-np.degrees(elbow[knot, side]):.1f} deg {_where(timing, knot)}. {_WHAT_TO_TRY}"
        )
