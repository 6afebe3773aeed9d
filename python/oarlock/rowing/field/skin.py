"""Soft-tissue artefacts of the field simulator: lag of skin, swelling muscle, moving straps, vibration.

Each is a shift and a rotation of the sensor relative to its link over time, in the link's axes. All but the random
wander are zero in the N-pose (q = 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import cont2discrete, lfilter

from oarlock.rowing.field.anatomy import Anatomy, apply
from oarlock.rowing.field.courses import generator, wander
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.placement import UnitErrors, direction
from oarlock.rowing.simulation.grip import SIDES
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats

_RINGS_HZ = 10.0
_DAMPING = 0.25
_G_M_S2 = 9.80665
# For each limb: the limb relative to which its rotation makes the skin lag, and the joint that swells its muscle.
_BEFORE = {"elbow": "shoulder", "wrist": "elbow"}


@dataclass(frozen=True, eq=False)
class Skin:
    """Displacement, m, and rotation vector, rad, of one unit relative to its link, in link axes, over time."""

    spline: BSpline | None

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Displacement (..., 3) and rotation vector (..., 3) at times (...)."""
        if self.spline is None:
            nothing = np.zeros((*time_s.shape, 3))
            return nothing, nothing
        both = np.asarray(self.spline(time_s))
        return both[..., :3], both[..., 3:]


@dataclass(frozen=True, eq=False)
class BoneMotion:
    """The body and the force on a bone over the knots: postures (K, n), specific force (K, 3) in link axes, m/s2."""

    timing: StrokeTiming
    posture: Floats
    force: Floats


def skin_of(
    name: str, unit: UnitErrors, anatomy: Anatomy, course: BoneMotion, effects: FieldEffects, seed: int
) -> Skin:
    """The soft tissue between one unit and its bone."""
    shift, turn = np.zeros((2, *course.force.shape))
    outward, across = _directions(unit, generator(seed, f"skin {name}"))
    side, _, part = unit.frame.partition("_")
    limb = side if part in _BEFORE else None
    swollen = 0.0 if part == "" else swelling(anatomy, limb, course.posture)[:, None]
    shift += effects.skin_shift_m * swollen * outward
    turn += effects.skin_tilt_rad * swollen * across
    if effects.skin_twist > 0.0 and part in _BEFORE:
        frames = (f"{side}_{_BEFORE[part]}", unit.frame)
        turn -= effects.skin_twist * twist(anatomy, frames, course.posture)
    if effects.wobble_rad > 0.0 or effects.wobble_m > 0.0:
        pulled = rung(course.timing.time_s, course.force - _at_rest(anatomy, unit, course.posture)) / _G_M_S2
        shift -= effects.wobble_m * pulled
        turn -= effects.wobble_rad * np.cross(outward, pulled)
    if effects.skin_wander_rad > 0.0:
        turn += effects.skin_wander_rad * _wander(name, course.timing, seed)
    if not (shift.any() or turn.any()):
        return Skin(None)
    return Skin(make_interp_spline(course.timing.time_s, np.hstack([shift, turn]), k=5))


def _directions(unit: UnitErrors, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Direction away from the bone, and the axis about which swelling tilts the unit."""
    place = unit.offset_m.copy()
    place[np.argmax(np.abs(place))] = 0.0  # along the limb, or sideways to the spine
    outward = place / np.linalg.norm(place) if place.any() else direction(rng)
    across = np.cross(outward, direction(rng))
    return outward, across / np.linalg.norm(across)


def _neutral(posture: Floats) -> Floats:
    return np.zeros((1, posture.shape[-1]))


def swelling(anatomy: Anatomy, side: str | None, posture: Floats) -> Floats:
    """(K,) 0 with the elbow straight, 1 at 90 deg; over the spine the mean of both arms' elevation instead."""
    if side is not None:
        return _bent(anatomy, (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"), posture)
    both = [_bent(anatomy, ("seat", f"{s}_shoulder", f"{s}_elbow"), posture) for s in SIDES]
    return np.asarray(0.5 * sum(both))


def _bent(anatomy: Anatomy, frames: tuple[str, str, str], posture: Floats) -> Floats:
    """Change of the cosine between two limbs since the N-pose: about 1 after a quarter turn."""
    first, second = _limbs(anatomy, frames, posture)
    hanging = np.sum(np.multiply(*_limbs(anatomy, frames, _neutral(posture))), axis=-1)
    return np.asarray(np.sign(hanging) * (hanging - np.sum(first * second, axis=-1)))


def _limbs(anatomy: Anatomy, frames: tuple[str, str, str], posture: Floats) -> tuple[Floats, Floats]:
    ends = [anatomy.poses(posture, frames)[frame][1] for frame in frames]
    limbs = [ends[1] - ends[0], ends[2] - ends[1]]
    return limbs[0] / np.linalg.norm(limbs[0], axis=-1, keepdims=True), limbs[1] / np.linalg.norm(
        limbs[1], axis=-1, keepdims=True
    )


def twist(anatomy: Anatomy, frames: tuple[str, str], posture: Floats) -> Floats:
    """Rotation vector (K, 3) of the limb's rotation about its length since the N-pose, in its axes.

    This is the twist of its rotation relative to the previous limb (swing and twist).
    """
    found, still = anatomy.poses(posture, frames), anatomy.poses(_neutral(posture), frames)
    between = np.swapaxes(found[frames[0]][0], -1, -2) @ found[frames[1]][0]
    start = np.swapaxes(still[frames[0]][0], -1, -2) @ still[frames[1]][0]
    turn = np.swapaxes(start, -1, -2) @ between
    length = still[frames[1]][1] - _limb_start(anatomy, frames[1], posture)
    axis = apply(np.swapaxes(still[frames[1]][0], -1, -2), length)[0]
    axis = axis / np.linalg.norm(axis)
    sine = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], -1
    )
    # tan(half twist) = (vector part of the quaternion along the axis) / (scalar part), from 4 w (w, v).
    angle = 2.0 * np.arctan2(sine @ axis, 1.0 + np.trace(turn, axis1=-2, axis2=-1))
    return np.asarray(np.unwrap(angle)[:, None] * axis)


def _limb_start(anatomy: Anatomy, frame: str, posture: Floats) -> Floats:
    side, _, part = frame.partition("_")
    before = f"{side}_{_BEFORE[part]}"
    return anatomy.poses(_neutral(posture), (before,))[before][1]


def _at_rest(anatomy: Anatomy, unit: UnitErrors, posture: Floats) -> Floats:
    """Specific force (3,) in link axes in the N-pose; the seat's x points up."""
    still = anatomy.poses(_neutral(posture), ("seat", unit.frame))
    return np.asarray(_G_M_S2 * still[unit.frame][0][0].T @ still["seat"][0][0][:, 0])


def rung(time_s: Floats, force: Floats) -> Floats:
    """Response (K, 3) of a damped oscillator to a force: x'' + 2 d w x' + w2 x = w2 force, from rest."""
    rate = 2.0 * np.pi * _RINGS_HZ
    system = ([rate**2], [1.0, 2.0 * _DAMPING * rate, rate**2])
    numerator, denominator, _ = cont2discrete(system, float(time_s[1] - time_s[0]), method="foh")
    return np.asarray(force[0] + lfilter(numerator[0], denominator, force - force[0], axis=0))


def _wander(name: str, timing: StrokeTiming, seed: int) -> Floats:
    """Random rotation vectors (K, 3) with an rms of 1 about each axis."""
    rng = generator(seed, f"wander {name}")
    turns = np.stack([wander(rng, timing) for _ in range(3)], axis=-1)
    return np.asarray(turns / np.sqrt(np.mean(turns**2, axis=0)))


def bone_force(time_s: Floats, place: Floats, rotation: Floats, up: Floats, gravity_m_s2: float) -> Floats:
    """Specific force (K, 3) in link axes of a bone at ``place`` (K, 3) in axes at rest, with vertical ``up`` (3,)."""
    acceleration = np.asarray(make_interp_spline(time_s, place, k=5)(time_s, 2))
    force: Any = acceleration + gravity_m_s2 * up
    return apply(np.swapaxes(rotation, -1, -2), np.asarray(force))
