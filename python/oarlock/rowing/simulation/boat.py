"""Surge of the simulated hull: one degree of freedom along the keel.

With v the hull's speed toward the bow and z the rower's centre of mass on the boat, positive toward the stern:

    (m_boat + m_rower) dv/dt = F(t) - c v |v| + m_rower d2z/dt2

Sources: Cabrera, Ruina and Kleshnev, Human Movement Science 25, 2006; Baudouin and Hawkins, British J. Sports Medicine
36, 2002; segment masses: Winter, Biomechanics and Motor Control of Human Movement, table 4.1. The shape of the force
curve is our choice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from scipy.interpolate import make_interp_spline

from oarlock.rowing.simulation.curves import PeriodicCurve
from oarlock.rowing.simulation.grip import SIDES, ArmKinematics
from oarlock.rowing.simulation.timing import DRIVE_RATIO_RANGE, StrokeTiming, warp
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_FORCE = PeriodicCurve.through(
    [(0.0, 0.0), (0.02, 0.0), (0.13, 1.0), (0.22, 0.95), (0.46, 0.0)], smoothing=0.025
).normalised()


def _mean_force() -> Polynomial:
    """Mean of the force curve over the cycle, as a function of the drive ratio."""
    ratios = np.linspace(*DRIVE_RATIO_RANGE, 9)
    strokes = np.arange(1000) / 1000.0
    return Polynomial.fit(ratios, [_FORCE(warp(strokes, ratio)).mean() for ratio in ratios], 5)


_MEAN_FORCE = _mean_force()
_RACE_RATE_SPM = 34.0
_RUN_IN_STROKES = 40

# Shares of body mass. The thigh follows the hip and half of the knee, which moves about half as far as the hip.
_TRUNK_AND_HEAD = 0.578
_THIGHS, _THIGH_CENTRE = 0.200, 0.433
_SHANKS, _SHANK_CENTRE = 0.093, 0.433
_UPPER_ARM, _UPPER_ARM_CENTRE = 0.028, 0.436
_FOREARM, _FOREARM_CENTRE = 0.016, 0.430
_HAND = 0.006
# Trunk at half, head and neck at 1.3 of the way from hip to shoulder.
_TRUNK_AND_HEAD_CENTRE = 0.62


@dataclass(frozen=True)
class Boat:
    """A single scull and its rower.

    Attributes:
        boat_kg: hull with oars and rigger, kg.
        rower_kg: rower, kg.
        drag_kg_m: drag over speed squared, N s2/m2.
        race_speed_m_s: mean speed at 34 strokes per minute, m/s; at other rates the work of a stroke is the
            same, so that the speed goes with the cube root of the rate.
    """

    boat_kg: float = 23.0
    rower_kg: float = 80.0
    drag_kg_m: float = 3.1
    race_speed_m_s: float = 4.6

    def __post_init__(self) -> None:
        for name in ("boat_kg", "rower_kg", "drag_kg_m", "race_speed_m_s"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise DataError(f"boat: {name} is {getattr(self, name)}; it must be positive and finite")


@dataclass(frozen=True, eq=False)
class HullMotion:
    """The hull along the keel; all arrays (K,).

    ``speed_m_s`` and ``propulsion_n`` are positive toward the bow; ``acceleration_m_s2`` is the coordinate
    acceleration along the root's Z, positive toward the stern.
    """

    time_s: Floats
    speed_m_s: Floats
    acceleration_m_s2: Floats
    propulsion_n: Floats


def rower_centre_of_mass(model: ArmKinematics, q: Floats) -> Floats:
    """Position (K,) of the rower's centre of mass along Z, m, up to a constant, from q (K, n_joints)."""
    poses = np.asarray(model.forward_kinematics(q), dtype=np.float64)
    frames = list(model.frame_names)

    def along(name: str) -> Floats:
        return np.asarray(poses[:, frames.index(name), 2, 3], dtype=np.float64)

    hip = along("seat")
    shoulder = 0.5 * (along("r_shoulder") + along("l_shoulder"))
    knee = 0.5 * hip
    total = _TRUNK_AND_HEAD * (hip + _TRUNK_AND_HEAD_CENTRE * (shoulder - hip))
    total += _THIGHS * (hip + _THIGH_CENTRE * (knee - hip)) + _SHANKS * knee * (1.0 - _SHANK_CENTRE)
    for side in SIDES:
        upper, elbow, wrist = (along(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        total += _UPPER_ARM * (upper + _UPPER_ARM_CENTRE * (elbow - upper))
        total += _FOREARM * (elbow + _FOREARM_CENTRE * (wrist - elbow))
        total += _HAND * along(f"{side}_hand")
    return total


def rower_segments(model: ArmKinematics, q: Floats) -> tuple[Floats, Floats]:
    """Shares (n,) of the body's mass, and places (K, n, 2) along Y and Z, m, from q (K, n_joints).

    Point masses about the root, with the legs at the height of the hips; the feet stand still and are left out.
    """
    poses = np.asarray(model.forward_kinematics(q), dtype=np.float64)
    frames = list(model.frame_names)

    def at(name: str) -> Floats:
        return np.asarray(poses[:, frames.index(name), 1:3, 3], dtype=np.float64)

    hip = at("seat")
    shoulder = 0.5 * (at("r_shoulder") + at("l_shoulder"))
    knee = hip * [1.0, 0.5]
    parts = [
        (_TRUNK_AND_HEAD, hip + _TRUNK_AND_HEAD_CENTRE * (shoulder - hip)),
        (_THIGHS, hip + _THIGH_CENTRE * (knee - hip)),
        (_SHANKS, knee * [1.0, 1.0 - _SHANK_CENTRE]),
    ]
    for side in SIDES:
        upper, elbow, wrist = (at(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        parts.append((_UPPER_ARM, upper + _UPPER_ARM_CENTRE * (elbow - upper)))
        parts.append((_FOREARM, elbow + _FOREARM_CENTRE * (wrist - elbow)))
        parts.append((_HAND, at(f"{side}_hand")))
    return np.array([share for share, _ in parts]), np.stack([place for _, place in parts], axis=1)


def propulsion(timing: StrokeTiming, boat: Boat) -> Floats:
    """Propulsive force (K,), N, toward the bow: whatever balances the mean drag at the rate's usual speed."""
    usual_speed = boat.race_speed_m_s * np.cbrt(timing.rate_spm / _RACE_RATE_SPM)
    peak = boat.drag_kg_m * usual_speed**2 / _MEAN_FORCE(timing.drive_ratio)
    return np.asarray(peak * _FORCE(timing.phase), dtype=np.float64)


def hull_motion(model: ArmKinematics, q: Floats, timing: StrokeTiming, boat: Boat) -> HullMotion:
    """Surge of the hull under a rower who moves as q (K, n_joints) at ``timing.time_s``.

    The speed starts where the first stroke, repeated, becomes periodic.
    """
    time = timing.time_s
    centre = make_interp_spline(time, rower_centre_of_mass(model, q), k=5)
    force = propulsion(timing, boat)
    mass = boat.boat_kg + boat.rower_kg
    # Hull speed = common speed + relative part; only the common speed needs integrating.
    relative = boat.rower_kg / mass * np.asarray(centre(time, 1), dtype=np.float64)
    common = _common_speed(timing, force / mass, boat.drag_kg_m / mass, relative, boat)
    speed = common + relative
    bow = force / mass - boat.drag_kg_m / mass * speed * np.abs(speed)
    bow = bow + boat.rower_kg / mass * np.asarray(centre(time, 2), dtype=np.float64)
    return HullMotion(time, speed, -bow, force)


def _common_speed(timing: StrokeTiming, force: Floats, drag: float, relative: Floats, boat: Boat) -> Floats:
    usual = boat.race_speed_m_s * float(np.cbrt(timing.rate_spm[0] / _RACE_RATE_SPM))
    first = timing.first_stroke
    if first.stop > first.start:
        for _ in range(_RUN_IN_STROKES):
            usual = float(_integrate(timing.time_s[first], force[first], drag, relative[first], usual)[-1])
    return _integrate(timing.time_s, force, drag, relative, usual)


def _integrate(time: Floats, force: Floats, drag: float, relative: Floats, start: float) -> Floats:
    """Heun's method on the knots: the common speed is smooth and its time constant is seconds."""
    steps, forces, moved = np.diff(time).tolist(), force.tolist(), relative.tolist()
    speeds = [start]
    for k, step in enumerate(steps):
        here = speeds[k] + moved[k]
        slope = forces[k] - drag * here * abs(here)
        there = speeds[k] + step * slope + moved[k + 1]
        speeds.append(speeds[k] + 0.5 * step * (slope + forces[k + 1] - drag * there * abs(there)))
    return np.array(speeds)
