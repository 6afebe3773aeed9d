"""One simulated field session of one athlete: body, motion and boat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from oarlock.model import ModelDescription, WorldDescription
from oarlock.rowing.field.anatomy import Anatomy, apply, rotation_about
from oarlock.rowing.field.courses import body_courses, generator, hull_courses
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.simulation.arms import WEIGHTS, preferred_arms
from oarlock.rowing.simulation.boat import Boat, hull_motion
from oarlock.rowing.simulation.grip import GripSolver
from oarlock.rowing.simulation.stroke_shape import StrokeShape, body_and_oars
from oarlock.rowing.simulation.timing import StrokeTiming, stroke_timing
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

KNOTS_HZ = 250.0
HANDS_HOLD = 1e-6
"""Tolerance of the hands on the handles: position, m, and difference of directions; slip is taken into account."""
_STRETCHER_ROUNDS = 12
_LARGEST_MOVE_M = 0.15
HULL_JOINTS = ("hull_sway", "hull_heave", "hull_yaw", "hull_pitch", "hull_roll")
"""Joints of a model whose root does not rotate with the boat, in this order: m, m, rad, rad, rad."""
# Centre of the hull's rotation from the hip pivot at seat 0: 0.2 m below it and 0.3 m toward the stern.
_BELOW_M, _STERNWARD_M = 0.2, 0.3


@dataclass(frozen=True, eq=False)
class Hull:
    """Motion of the boat over time, relative to axes at rest (those of the root of a still boat).

    ``angles_rad`` has pitch, roll and yaw, ``heave_m`` the upward displacement, ``surge_m_s2`` the acceleration of the
    root's origin along ``forward`` (stern positive) and ``surge_m`` the resulting displacement from rest.
    """

    angles_rad: BSpline
    heave_m: BSpline
    surge_m_s2: BSpline
    surge_m: BSpline
    up: Floats
    forward: Floats

    def pose(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Rotation (..., 3, 3) of the root relative to axes at rest, and position (..., 3) of its origin in them."""
        pitch, roll, yaw = np.moveaxis(np.asarray(self.angles_rad(time_s)), -1, 0)
        left = np.cross(self.up, self.forward)
        rotation = (
            rotation_about(self.up, yaw) @ rotation_about(left, pitch) @ rotation_about(self.forward, roll)
        )
        pivot = _STERNWARD_M * self.forward - _BELOW_M * self.up
        rocked = pivot - apply(rotation, pivot)
        rocked = rocked - (rocked @ self.forward)[..., None] * self.forward
        way = self.heave_m(time_s)[..., None] * self.up + self.surge_m(time_s)[..., None] * self.forward
        return rotation, np.asarray(way + rocked)

    def at_joints(self, time_s: Floats) -> dict[str, Floats]:
        """The same as values (K,) of a model's hull joints; surge has no joint."""
        _, place = self.pose(time_s)
        pitch, roll, yaw = np.moveaxis(np.asarray(self.angles_rad(time_s)), -1, 0)
        sway, heave = place @ np.cross(self.up, self.forward), place @ self.up
        return dict(zip(HULL_JOINTS, (sway, heave, yaw, pitch, roll), strict=True))

    def level(self) -> Hull:
        """The motion of a root that moves with such a hull but does not rotate."""
        return replace(self, angles_rad=_nothing(self.angles_rad), heave_m=_nothing(self.heave_m))


def _nothing(spline: BSpline) -> BSpline:
    return BSpline(spline.t, np.zeros_like(spline.c), spline.k)


@dataclass(frozen=True, eq=False)
class FieldSession:
    """The moving body: postures (K, n) over ``timing.time_s`` with their spline, and the hull.

    ``carrier`` is the part of the hull's motion for which the model has no joint: all of it if the root is the boat.
    """

    anatomy: Anatomy
    timing: StrokeTiming
    posture: Floats
    spline: BSpline
    hull: Hull
    carrier: Hull

    def boat(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Rotation (..., 3, 3) and origin (..., 3) of the boat's frame in root axes at times (...)."""
        name = self.anatomy.boat
        return self.anatomy.poses(np.asarray(self.spline(time_s)), (name,))[name]


def rowed(
    description: ModelDescription,
    nominal: ModelDescription,
    effects: FieldEffects,
    surge: bool,
    duration_s: float,
    rate_spm: float | Sequence[float],
    seed: int,
) -> FieldSession:
    """Row a piece with the true body (``description``); with all effects off it is `oarlock.rowing.sculling`'s.

    The rower has set the stretcher so that the arms have the reach that they would have with the nominal lengths.

    Raises:
        DataError: the hands cannot reach the handles.
    """
    anatomy = Anatomy(description, _grip_directions(seed))
    time = np.linspace(0.0, duration_s, max(6, int(np.ceil(duration_s * KNOTS_HZ)) + 1))
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time, rate_spm, None, 1.0, streams[0])
    joints = body_and_oars(StrokeShape(), timing, 1.0, streams[1])
    preferred = preferred_arms(timing, StrokeShape().asymmetry, 1.0, streams[2])
    posture = _laid_out(anatomy, joints | body_courses(effects, timing, seed))
    posture[:, anatomy.columns(["seat"])] += _stretcher(anatomy, nominal, posture)
    posture = _held(anatomy, time, posture, preferred)
    hull = _hull(anatomy, nominal.world, effects, timing, posture, surge, seed)
    carrier = hull
    if set(HULL_JOINTS) <= set(anatomy.own_joint_names):
        for name, value in hull.at_joints(time).items():
            posture[:, anatomy.columns([name])] = value[:, None]
        carrier = hull.level()
    return FieldSession(anatomy, timing, posture, make_interp_spline(time, posture, k=5), hull, carrier)


def _grip_directions(seed: int) -> tuple[float, float]:
    right, left = generator(seed, "grip direction").uniform(-np.pi, np.pi, 2)
    return float(right), float(left)


def _laid_out(anatomy: Anatomy, courses: Mapping[str, Floats]) -> Floats:
    posture = np.zeros((next(iter(courses.values())).size, len(anatomy.joint_names)))
    for name, value in courses.items():
        if name in anatomy.joint_names:
            posture[:, anatomy.columns([name])] = value[:, None]
    return posture


def _stretcher(anatomy: Anatomy, nominal: ModelDescription, posture: Floats) -> float:
    """Shift of the seat's travel toward the stern, m; 0 if the true body reaches as far as the nominal one."""
    usual = Anatomy(nominal)
    neutral = posture.copy()
    neutral[:, len(usual.own_joint_names) :] = 0.0
    wanted = GripSolver(usual, WEIGHTS).excess_reach(neutral[::10]).max()
    solver, moved = GripSolver(anatomy, WEIGHTS), 0.0
    fitted = posture[::10].copy()
    for _ in range(_STRETCHER_ROUNDS):
        lacking = float(solver.excess_reach(fitted).max() - wanted)
        if lacking <= 0.0 or moved > _LARGEST_MOVE_M:
            break
        step = lacking + 1e-4
        moved += step
        fitted[:, anatomy.columns(["seat"])] += step
    return moved


def _held(anatomy: Anatomy, time: Floats, posture: Floats, preferred: Floats) -> Floats:
    solver = GripSolver(anatomy, WEIGHTS)
    excess = solver.excess_reach(posture)
    if excess.max() > 0.0:
        raise DataError(
            f"field simulator: with these effects a handle is {1e3 * excess.max():.1f} mm beyond the stretched arm at "
            f"{time[int(excess.max(axis=1).argmax())]:.2f} s. Try smaller effects (length_error, "
            "shoulder_protraction_m, rig_error_m), another seed, or longer arms"
        )
    held = solver.solve(time, posture, preferred)
    apart, turned = solver.closure(held)
    worst = max(float(apart.max()), float(turned.max()))
    if not worst < HANDS_HOLD:
        at = int(np.nanargmax(np.maximum(apart, turned).max(axis=1)))
        raise DataError(
            f"field simulator: no posture reaches handles at {time[at]:.2f} s ({1e3 * apart[at].max():.2f} mm off). "
            "Try smaller effects (grip_turn_rad, length_error, rig_error_m) or another seed"
        )
    return held


def _hull(
    anatomy: Anatomy,
    world: WorldDescription,
    effects: FieldEffects,
    timing: StrokeTiming,
    posture: Floats,
    surge: bool,
    seed: int,
) -> Hull:
    """A stationary boat neither surges nor rotates."""
    time = timing.time_s
    afloat = effects if surge else replace(effects, **dict.fromkeys(_ROCKING, 0.0))
    rocks = hull_courses(afloat, timing, seed)
    acceleration = (
        hull_motion(anatomy, posture, timing, Boat()).acceleration_m_s2 if surge else np.zeros_like(time)
    )
    surging = make_interp_spline(time, acceleration, k=5)
    angles = np.stack([rocks[f"hull_{name}"] for name in ("pitch", "roll", "yaw")], axis=-1)
    heave = make_interp_spline(time, rocks["hull_heave"], k=5)
    return Hull(
        make_interp_spline(time, angles, k=5),
        heave,
        surging,
        surging.antiderivative(2),
        np.asarray(world.up, dtype=np.float64),
        np.asarray(world.forward, dtype=np.float64),
    )


_ROCKING = ("hull_pitch_rad", "hull_roll_rad", "hull_yaw_rad", "hull_heave_m")
