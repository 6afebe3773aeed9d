"""Simulates rowing on an ergometer with one handle on a chain, on the floor or on slides.

Order and timing of legs, trunk and arms are a sculler's; the handle moves nearly level, a little lower in the recovery.
On slides, without friction, the common centre of mass stays in place; with z the rower's on the machine:

    (m_machine + m_rower) a = - m_rower d2z/dt2
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from scipy.interpolate import make_interp_spline

from oarlock.rowing.simulation.arms import WEIGHTS, preferred_arms
from oarlock.rowing.simulation.boat import Boat, rower_centre_of_mass
from oarlock.rowing.simulation.curves import Variation
from oarlock.rowing.simulation.grip import ArmKinematics, GripSolver
from oarlock.rowing.simulation.holding import Holding
from oarlock.rowing.simulation.motion import Piece, check_joints, held_piece, knots
from oarlock.rowing.simulation.stroke_shape import (
    StrokeShape,
    between,
    handle_height,
    oar_sweep,
    seat_and_trunk,
)
from oarlock.rowing.simulation.timing import StrokeTiming, stroke_timing
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

HANDLE_JOINTS = ("chain_yaw", "chain_pitch", "handle", "handle_yaw")
_HANDLE_SD_M = 0.008
_HEIGHT_SD_M = 0.004
_SIDEWAYS_SD_RAD = radians(0.4)
_BAR_SD_RAD = radians(1.0)
_WHAT_TO_TRY = (
    "Draw less chain (handle_m), move the seat (seat_m), try more lean, or check the lengths of arms and trunk and "
    "where the chain leaves the machine"
)


@dataclass(frozen=True)
class ErgometerShape(StrokeShape):
    """Ends of the movements of a stroke on the ergometer, in addition to seat and trunk of `StrokeShape`.

    Attributes:
        handle_m: chain drawn out at (catch, finish), m.
        height_m: of the middle of the handle over the hip pivot, m, (recovery, drive).
    """

    handle_m: tuple[float, float] = (0.28, 1.57)
    height_m: tuple[float, float] = (0.20, 0.27)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.handle_m[0] < self.handle_m[1]:
            raise DataError(
                f"stroke: handle_m is {self.handle_m}; the chain is drawn out from catch to finish"
            )
        if not self.height_m[0] <= self.height_m[1]:
            raise DataError(f"stroke: height_m is {self.height_m}; the handle is higher in the drive")


@dataclass(frozen=True)
class Machine:
    """What runs on the slides under the rower, kg."""

    machine_kg: float = 32.0
    rower_kg: float = 80.0

    def __post_init__(self) -> None:
        for name in ("machine_kg", "rower_kg"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise DataError(f"machine: {name} is {getattr(self, name)}; it must be positive and finite")


def ergometer_piece(
    model: ArmKinematics,
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    *,
    drive_ratio: float | None = None,
    shape: ErgometerShape | None = None,
    variation: float = 1.0,
    machine: Machine | None = None,
    slides: bool = False,
    start_s: float = 0.0,
    seed: int = 0,
    knots_hz: float = 250.0,
) -> Piece:
    """Simulate a piece on the ergometer; both hands are on the handle to 1e-6 m.

    Arguments are those of :func:`row_piece`, but for the boat; the model is `ergometer` or one with its joint and frame
    names. With `slides` the machine runs freely along Z, with the masses of `machine` (None: 32 kg under 80 kg);
    without, it stands on the floor (``base_acceleration_m_s2`` is None).

    Raises:
        DataError: the hands cannot hold the handle somewhere, or an argument is out of range.
    """
    shape = ErgometerShape() if shape is None else shape
    time = knots(duration_s, start_s, knots_hz, variation)
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time, rate_spm, drive_ratio, variation, streams[0])
    check_joints(model, ("seat", "trunk", *HANDLE_JOINTS), "ergometer")
    fixed = _body_and_handle(model, shape, timing, variation, streams[1])
    preferred = preferred_arms(timing, shape.asymmetry, variation, streams[2])
    holding = Holding(
        GripSolver(model, WEIGHTS), timing, "ergometer", {"r": "right", "l": "left"}, _WHAT_TO_TRY
    )
    piece = held_piece(model, fixed, preferred, holding, Boat(), surge=False)
    return _on_slides(model, piece, Machine() if machine is None else machine) if slides else piece


def _body_and_handle(
    model: ArmKinematics,
    shape: ErgometerShape,
    timing: StrokeTiming,
    variation: float,
    rng: np.random.Generator,
) -> dict[str, Floats]:
    """Every joint (K,) but the arms'."""
    vary = Variation(rng, timing.stroke)
    body = seat_and_trunk(shape, timing, vary, variation)
    drawn = between(shape.handle_m, _drawn(shape, timing.phase), vary, variation * _HANDLE_SD_M)
    height = between(shape.height_m, handle_height(timing.phase), vary, variation * _HEIGHT_SD_M)
    return body | {
        "handle": drawn,
        "chain_pitch": np.arcsin((height - _chain_height_m(model)) / drawn),
        "chain_yaw": vary.draw(variation * _SIDEWAYS_SD_RAD),
        "handle_yaw": vary.draw(variation * _BAR_SD_RAD),
    }


def _drawn(shape: ErgometerShape, phase: Floats) -> Floats:
    """Share (K,) of the chain, as a sculler's hands go along the boat, which body and arms are timed for."""
    ends = np.sin(shape.phi_rad)
    along = np.sin(shape.phi_rad[0] + (shape.phi_rad[1] - shape.phi_rad[0]) * oar_sweep(phase))
    return np.asarray((along - ends[0]) / (ends[1] - ends[0]), dtype=np.float64)


def _chain_height_m(model: ArmKinematics) -> float:
    poses = np.asarray(model.forward_kinematics(np.zeros(len(model.joint_names))), dtype=np.float64)
    return float(poses[list(model.frame_names).index("chain_end"), 1, 3])


def _on_slides(model: ArmKinematics, piece: Piece, machine: Machine) -> Piece:
    time, q = piece.motion.time_s, piece.motion.q
    share = machine.rower_kg / (machine.machine_kg + machine.rower_kg)
    base = np.zeros((time.size, 3))
    base[:, 2] = -share * make_interp_spline(time, rower_centre_of_mass(model, q), k=5)(time, 2)
    motion = Motion(piece.motion.joint_names, time, q, base)
    return Piece(motion, piece.timing, None, piece.closure_m, piece.closure_axis)
