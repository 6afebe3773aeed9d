"""Time courses of deviations and hull motion in the field simulator; their maximum is the requested strength."""

from __future__ import annotations

from zlib import crc32

import numpy as np

from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.simulation.curves import PeriodicCurve, Variation
from oarlock.rowing.simulation.grip import SIDES
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats

# Values at catch, mid-drive, finish, hands away, mid-recovery. Only the shape matters: effects give the strengths.
_CURVES = {
    "spine_bend": PeriodicCurve.through([(0.0, -1.0), (0.25, -0.6), (0.5, 0.2), (0.7, -0.5)], 0.06),
    "protraction": PeriodicCurve.through(
        [(0.0, 1.0), (0.2, 0.7), (0.5, -1.0), (0.65, 0.1), (0.85, 0.7)], 0.05
    ),
    "elevation": PeriodicCurve.through(
        [(0.0, 0.1), (0.3, 0.1), (0.48, 1.0), (0.65, -0.3), (0.85, -0.2)], 0.05
    ),
    "grip_slip": PeriodicCurve.through([(0.0, -1.0), (0.3, -0.3), (0.5, 1.0), (0.75, 0.0)], 0.06),
    "grip_turn": PeriodicCurve.through([(0.0, 1.0), (0.3, 0.4), (0.5, -1.0), (0.75, -0.2)], 0.06),
    "hull_pitch": PeriodicCurve.through([(0.0, 1.0), (0.25, 0.3), (0.5, -1.0), (0.75, 0.2)], 0.08),
    "hull_yaw": PeriodicCurve.through([(0.0, 0.0), (0.3, 1.0), (0.6, 0.0), (0.8, -0.6)], 0.08),
    "hull_heave": PeriodicCurve.through([(0.0, -1.0), (0.25, 0.5), (0.5, 0.2), (0.75, 0.4)], 0.08),
}
# Share of a course that is the same in every stroke; the rest varies.
_REGULAR = {"hull_roll": 0.0, "trunk_twist": 0.0, "hull_yaw": 0.5}
_USUALLY_REGULAR = 0.8


def generator(seed: int, purpose: str) -> np.random.Generator:
    """A random generator for one purpose, so that no effect changes the random numbers of another."""
    return np.random.default_rng([seed, crc32(purpose.encode())])


def body_courses(effects: FieldEffects, timing: StrokeTiming, seed: int) -> dict[str, Floats]:
    """Deviations of the skeleton by name, (K,) each, m and rad; zero where they are off."""
    strengths = {
        "spine_bend": effects.spine_bend_rad,
        "trunk_twist": effects.trunk_twist_rad,
    }
    own = {
        "protraction": effects.shoulder_protraction_m,
        "elevation": effects.shoulder_elevation_m,
        "grip_slip": effects.grip_slip_m,
        "grip_turn": effects.grip_turn_rad,
    }
    strengths |= {f"{side}_{name}": strength for side in SIDES for name, strength in own.items()}
    return {name: course(name, strength, timing, seed) for name, strength in strengths.items()}


def hull_courses(effects: FieldEffects, timing: StrokeTiming, seed: int) -> dict[str, Floats]:
    """`hull_pitch`, `hull_roll`, `hull_yaw` (rad) and `hull_heave` (m), (K,) each."""
    strengths = {
        "hull_pitch": effects.hull_pitch_rad,
        "hull_roll": effects.hull_roll_rad,
        "hull_yaw": effects.hull_yaw_rad,
        "hull_heave": effects.hull_heave_m,
    }
    return {name: course(name, strength, timing, seed) for name, strength in strengths.items()}


def course(name: str, strength: float, timing: StrokeTiming, seed: int) -> Floats:
    """A curve (K,) that repeats with the strokes, with some variation; its peak is the strength."""
    if strength == 0.0:
        return np.zeros_like(timing.time_s)
    kind = name.removeprefix("r_").removeprefix("l_")
    regular = _REGULAR.get(kind, _USUALLY_REGULAR)
    shape = (1.0 - regular) * wander(generator(seed, name), timing)
    if regular > 0.0:
        shape = shape + regular * _CURVES[kind](timing.phase)
    return np.asarray(strength * shape / np.abs(shape).max())


def wander(rng: np.random.Generator, timing: StrokeTiming) -> Floats:
    """A smooth random curve (K,) of standard deviation 1 that changes from stroke to stroke."""
    return Variation(rng, timing.stroke).draw(1.0)
