"""Simulates sweep rowing: one oar with both hands; the trunk rotates and bends toward the rigger at the catch.

Trunk rotation and bending (Strahan et al., Clinical J. Sport Medicine 21, 2011) are the smallest with which both arms
reach and no wrist exceeds its range. Oar: catch near -54 deg and finish near +33 to +36 deg (NK Sports' guideline, the
Dutch federation's targets); spread 83 to 87 cm (Concept2's rigging pages), overlap 30 to 40 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from oarlock.rowing.simulation.arms import SCULLER, WEIGHTS, arm_curves, arms_near
from oarlock.rowing.simulation.boat import Boat
from oarlock.rowing.simulation.curves import Variation
from oarlock.rowing.simulation.grip import ArmKinematics, GripSolver
from oarlock.rowing.simulation.holding import Holding
from oarlock.rowing.simulation.motion import Piece, check_joints, held_piece, knots, motion_of
from oarlock.rowing.simulation.pitch import HullForm
from oarlock.rowing.simulation.stroke_shape import StrokeShape, between, oar_sweep, seat_and_trunk, single_oar
from oarlock.rowing.simulation.timing import StrokeTiming, stroke_timing
from oarlock.storage.arrays import Floats

# Of an outside arm as if it were the right one; the inside arm prefers a sculler's postures.
_OUTSIDE = arm_curves(
    {
        "shoulder_abduction": (8.0, 30.0, 15.0, -10.0, 15.0, 30.0),
        "shoulder_rotation": (5.0, -8.0, -18.0, -25.0, -18.0, -6.0),
        "shoulder_flexion": (70.0, 55.0, 10.0, -25.0, 12.0, 55.0),
        "elbow_flexion": (20.0, 25.0, 60.0, 95.0, 60.0, 25.0),
        "elbow_rotation": (-76.0, -62.0, -70.0, -80.0, -70.0, -60.0),
        "hand_abduction": (22.0, 0.0, -22.0, -45.0, -28.0, 0.0),
        "hand_flexion": (-3.0, -18.0, -28.0, -40.0, -38.0, -26.0),
    }
)
_TURN_SD_RAD = radians(0.7)
_WHAT_TO_TRY = (
    "Try a smaller catch angle (phi_rad), more rotation toward the rigger (rotation_rad) or forward lean, or check the "
    "lengths of arms and trunk, the pin and the inboard"
)
PAIR_SEAT = Boat(boat_kg=16.0, rower_kg=85.0, drag_kg_m=2.6, race_speed_m_s=4.9)
"""One of the two rowers of a coxless pair, with half of its hull, oars and drag."""
PAIR_HULL = HullForm(length_m=9.7, beam_m=0.34, inertia_kg_m2=170.0, rowers=2)
"""The hull of a coxless pair: 28 kg, 10 m long."""


@dataclass(frozen=True)
class SweepShape(StrokeShape):
    """Ends of the movements of a sweep stroke, in addition to those of `StrokeShape`; pairs are (catch, finish).

    Attributes:
        bend_rad: trunk bent sideways, rad, positive toward the rigger.
        rotation_rad: shoulders turned about the trunk's length, rad, positive toward the rigger.
        asymmetry: how much the two arms' habits differ.
    """

    seat_m: tuple[float, float] = (0.64, 0.01)
    lean_rad: tuple[float, float] = (radians(-27.0), radians(26.0))
    phi_rad: tuple[float, float] = (radians(-54.0), radians(33.0))
    alpha_rad: tuple[float, float] = (radians(1.5), radians(6.0))
    bend_rad: tuple[float, float] = (radians(9.0), radians(-3.0))
    rotation_rad: tuple[float, float] = (radians(30.0), radians(-13.0))


def on_starboard(model: ArmKinematics) -> bool:
    """Whether the oar of a sweep model lies on the rower's left."""
    poses = np.asarray(model.forward_kinematics(np.zeros(len(model.joint_names))))
    return bool(poses[list(model.frame_names).index("oarlock"), 0, 3] > 0.0)


def sweep_piece(
    model: ArmKinematics,
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    *,
    drive_ratio: float | None = None,
    shape: SweepShape | None = None,
    variation: float = 1.0,
    boat: Boat | None = None,
    surge: bool = True,
    start_s: float = 0.0,
    seed: int = 0,
    knots_hz: float = 250.0,
) -> Piece:
    """Simulate sweep rowing with strokes, boat speed and closure residuals; both hands are on the handle to 1e-6 m.

    Arguments are those of :func:`row_piece`; the model is `sweep`, `sweep_starboard` or one with their joint and frame
    names, and the default boat is half a coxless pair.

    Raises:
        DataError: a hand cannot hold the handle somewhere, or an argument is out of range.
    """
    shape = SweepShape() if shape is None else shape
    time = knots(duration_s, start_s, knots_hz, variation)
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time, rate_spm, drive_ratio, variation, streams[0])
    check_joints(model, ("trunk_bend", "trunk_rotation", "oar_phi"), "sweep")
    starboard = on_starboard(model)
    fixed = _body_and_oar(shape, timing, variation, streams[1], 1.0 if starboard else -1.0)
    arms = (_OUTSIDE, SCULLER) if starboard else (SCULLER, _OUTSIDE)
    preferred = arms_near(*arms, timing, shape.asymmetry, variation, streams[2])
    right, left = ("right (outside)", "left (inside)") if starboard else ("right (inside)", "left (outside)")
    holding = Holding(GripSolver(model, WEIGHTS), timing, "sweep", {"r": right, "l": left}, _WHAT_TO_TRY)
    return held_piece(model, fixed, preferred, holding, PAIR_SEAT if boat is None else boat, surge)


sweeping = motion_of(sweep_piece, "sweeping", "Sweep rowing")


def _body_and_oar(
    shape: SweepShape, timing: StrokeTiming, variation: float, rng: np.random.Generator, left: float
) -> dict[str, Floats]:
    """Every joint (K,) but the arms'; ``left`` is 1 if the rigger is on the rower's left, else -1."""
    vary = Variation(rng, timing.stroke)
    share = oar_sweep(timing.phase)
    scale = variation * _TURN_SD_RAD
    turned = {
        "trunk_bend": -left * between(shape.bend_rad, share, vary, scale),
        "trunk_rotation": left * between(shape.rotation_rad, share, vary, scale),
    }
    body = seat_and_trunk(shape, timing, vary, variation)
    return body | turned | single_oar(shape, timing, vary, variation)
