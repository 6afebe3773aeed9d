"""Simulates the published experiment: sculling, surge, noise and biases of Table 5; also rotating hulls, ergometers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from oarlock.rowing.simulation.boat import Boat, rower_centre_of_mass
from oarlock.rowing.simulation.ergometer import ergometer_piece
from oarlock.rowing.simulation.hull import HULL_JOINTS, HullRotation, on_hull, turning_hull
from oarlock.rowing.simulation.motion import Piece, row_piece
from oarlock.rowing.simulation.noise import SimulatedCondition, condition_named
from oarlock.rowing.simulation.pitch import HullForm, hull_pitch
from oarlock.rowing.simulation.stroke_shape import StrokeShape
from oarlock.rowing.simulation.sweep import PAIR_HULL, PAIR_SEAT, sweep_piece
from oarlock.simulation.motion import Motion

if TYPE_CHECKING:
    from oarlock import Model, Recording, Track

_HULL_STREAM = 3
"""Children 0 to 2 of the seed belong to the strokes."""


def simulate_sculling(
    model: Model,
    condition: str = "B-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    seed: int = 0,
    *,
    hull_rotation: HullRotation | None = None,
    pitching: bool = False,
    shape: StrokeShape | None = None,
    last_third: StrokeShape | None = None,
) -> tuple[Track, Recording]:
    """Truth and recording of a simulated sculler.

    A hull that turns needs no model that knows of it: the sensors feel the rotation all the same, and the truth
    holds the model's own joints.

    Args:
        model: `sculler`, `sculler_boat`, or a model with the joints, frames and sensors of one of them.
        condition: `S-NB`, `B-NB`, `S-B` or `B-B`: boat still or surging, sensors without or with biases.
        duration_s: length, s.
        rate_spm: strokes per minute; two values go evenly from one to the other.
        seed: of the stroke-to-stroke variation, of the hull's rotation and of the sensors' noise.
        hull_rotation: prescribed rotation of the hull; None leaves it level.
        pitching: the hull pitches under the rower's weight, beside what is prescribed; it must surge for that.
        shape: of the strokes, as of :func:`row_piece`.
        last_third: as of :func:`row_piece`.

    Raises:
        ValueError: an unknown condition, or a boat that is to pitch and to stand still.
        DataError: the model cannot row so.
    """
    chosen = _condition(condition, pitching)
    row = partial(
        row_piece,
        duration_s=duration_s,
        rate_spm=rate_spm,
        shape=shape,
        last_third=last_third,
        surge=chosen.boat_surge,
        seed=seed,
    )
    return _recorded(model, row, chosen, seed, _Hull(hull_rotation, pitching, HullForm(), Boat()))


def simulate_sweep(
    model: Model,
    condition: str = "B-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    seed: int = 0,
    *,
    hull_rotation: HullRotation | None = None,
    pitching: bool = False,
) -> tuple[Track, Recording]:
    """Truth and recording of a simulated sweep rower in a coxless pair.

    Arguments and errors are those of :func:`simulate_sculling`; the model is `sweep`, `sweep_starboard` or one with
    their joints, frames and sensors.
    """
    chosen = _condition(condition, pitching)
    row = partial(sweep_piece, duration_s=duration_s, rate_spm=rate_spm, surge=chosen.boat_surge, seed=seed)
    return _recorded(model, row, chosen, seed, _Hull(hull_rotation, pitching, PAIR_HULL, PAIR_SEAT))


def simulate_ergometer(
    model: Model,
    condition: str = "S-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    seed: int = 0,
) -> tuple[Track, Recording]:
    """Truth and recording of a simulated rower on an ergometer.

    Arguments and errors are those of :func:`simulate_sculling`; the model is `ergometer` or one with its joints, frames
    and sensors; conditions S- are on the floor, B- on slides.
    """
    chosen = condition_named(condition)
    row = partial(
        ergometer_piece, duration_s=duration_s, rate_spm=rate_spm, slides=chosen.boat_surge, seed=seed
    )
    return _recorded(model, row, chosen, seed, _Hull(None, False, HullForm(), Boat()))


def simulate_rowing(
    model: Model,
    condition: str = "B-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = 24.0,
    seed: int = 0,
    *,
    hull_rotation: HullRotation | None = None,
    pitching: bool = False,
) -> tuple[Track, Recording]:
    """:func:`simulate_sweep`, :func:`simulate_ergometer` or :func:`simulate_sculling`, as the model has it.

    Raises:
        ValueError: an ergometer whose hull is to turn, or what those functions refuse.
    """
    if "handle" in model.joint_names:
        if pitching or hull_rotation is not None:
            raise ValueError("an ergometer is on the floor or on slides; it does not pitch, roll or yaw")
        return simulate_ergometer(model, condition, duration_s, rate_spm, seed)
    row = simulate_sweep if "oar_phi" in model.joint_names else simulate_sculling
    return row(model, condition, duration_s, rate_spm, seed, hull_rotation=hull_rotation, pitching=pitching)


@dataclass(frozen=True)
class _Hull:
    """Rotations of the hull in addition to surge."""

    rotation: HullRotation | None
    pitching: bool
    form: HullForm
    boat: Boat

    def turned(self, model: Model, piece: Piece, seed: int) -> Motion:
        """The piece's motion in a hull that turns about its centre of flotation."""
        angles = {}
        if self.rotation is not None:
            random = np.random.default_rng(seed).spawn(_HULL_STREAM + 1)[_HULL_STREAM]
            angles = self.rotation.angles(piece.timing, random)
        if self.pitching and piece.hull is not None:
            own = hull_pitch(model, piece.motion.q, piece.timing, piece.hull, self.boat, self.form)
            angles["hull_pitch"] = angles.get("hull_pitch", 0.0) + own.angle_rad
        pivot_m = np.array([0.0, -self.form.hip_height_m, self.form.flotation_z_m])
        shifted = np.zeros(piece.motion.time_s.size)
        if piece.hull is not None:
            share = self.boat.rower_kg / (self.boat.boat_kg + self.boat.rower_kg)
            centre = rower_centre_of_mass(model, piece.motion.q)
            shifted = -share * (centre - centre.mean())
        return turning_hull(piece.motion, angles, pivot_m, shifted)


def _condition(name: str, pitching: bool) -> SimulatedCondition:
    chosen = condition_named(name)
    if pitching and not chosen.boat_surge:
        raise ValueError(f"condition {name} is a stationary boat; it pitches in B-NB and B-B")
    return chosen


def _recorded(
    model: Model, row: Callable[[Model], Piece], condition: SimulatedCondition, seed: int, hull: _Hull
) -> tuple[Track, Recording]:
    from oarlock import simulate

    turns = hull.pitching or hull.rotation is not None
    body = on_hull(model) if turns else model
    piece = row(body)
    motion = hull.turned(body, piece, seed) if turns else piece.motion
    truth, recording = simulate(
        body,
        motion,
        gyro_bias_rad_s=condition.gyro_bias_rad_s,
        accel_bias_m_s2=condition.accel_bias_m_s2,
        seed=seed,
    )
    return (truth if body is model else _truth_aboard(model, motion)), recording


def _truth_aboard(model: Model, motion: Motion) -> Track:
    """The truth of a model that takes the hull for its root."""
    from oarlock import simulate

    kept = [k for k, name in enumerate(motion.joint_names) if name not in HULL_JOINTS]
    own = Motion(tuple(motion.joint_names[k] for k in kept), motion.time_s, motion.q[:, kept])
    return simulate(model, own, sensors=model.sensor_names[:1])[0]
