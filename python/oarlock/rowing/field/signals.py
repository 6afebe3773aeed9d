"""Ideal sensor signals of the field simulator, from differentiated poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from oarlock.model import WorldDescription
from oarlock.rowing.field.anatomy import apply, rotation_by
from oarlock.rowing.field.courses import generator
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.placement import UnitErrors, direction
from oarlock.rowing.field.session import FieldSession
from oarlock.rowing.field.skin import Skin
from oarlock.storage.arrays import Floats

STEP_S = 2e-3
REACH = 4
"""Number of poses on each side of an instant that are used for differentiation."""
# Central differences of eighth order (Fornberg, Mathematics of Computation 51, 1988), for steps 1 to 4.
_FIRST = np.array([4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0])
_SECOND = np.array([8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0])
_CHUNK = 2000
# Iron of the boat: a dipole below the middle of the rail; its strength is the field at 0.3 m.
_IRON_BELOW_M, _IRON_STERNWARD_M, _NAMED_AT_M = 0.15, 0.35, 0.3
_IRON_NEAREST_M = 0.1


class IdealReadings(NamedTuple):
    """Angular velocity rad/s, specific force m/s2 and magnetic field uT, (N, 3) each, in sensor axes."""

    gyro_rad_s: Floats
    accel_m_s2: Floats
    field_ut: Floats


@dataclass(frozen=True, eq=False)
class AmbientFields:
    """Gravity and the magnetic field, in axes at rest; the boat's iron in the boat's axes."""

    gravity_m_s2: float
    up: Floats
    field_ut: Floats
    iron_place_m: Floats
    iron_ut: Floats

    @classmethod
    def of(cls, world: WorldDescription, effects: FieldEffects, seed: int) -> AmbientFields:
        """The surroundings from a description's world; the seed rotates the iron."""
        up, forward = np.asarray(world.up), np.asarray(world.forward)
        azimuth, dip = world.magnetic_azimuth_rad, world.magnetic_dip_rad
        level = np.cos(azimuth) * forward + np.sin(azimuth) * np.cross(up, forward)
        field = world.magnetic_norm_ut * (np.cos(dip) * level - np.sin(dip) * up)
        place = _IRON_STERNWARD_M * forward - _IRON_BELOW_M * up
        moment = effects.rail_iron_ut * direction(generator(seed, "rail iron"))
        return cls(world.gravity_m_s2, up, field, place, moment)

    def iron_field(self, place_m: Floats) -> Floats:
        """Field (..., 3), uT, of the boat's iron (a dipole) at positions (..., 3) in the boat's axes."""
        reach = place_m - self.iron_place_m
        distance = np.maximum(np.linalg.norm(reach, axis=-1), _IRON_NEAREST_M)[..., None]
        along = np.sum(reach * self.iron_ut, axis=-1)[..., None] / distance**2 * reach
        return np.asarray((_NAMED_AT_M / distance) ** 3 * (1.5 * along - 0.5 * self.iron_ut))


def ideal_readings(
    session: FieldSession, surroundings: AmbientFields, unit: UnitErrors, skin: Skin, time_s: Floats
) -> IdealReadings:
    """Ideal readings at times (N,); the field is in sensor axes, without hard and soft iron."""
    if time_s.size == 0:
        return IdealReadings(*(np.zeros((0, 3)) for _ in range(3)))
    parts = [
        _readings_of(session, surroundings, unit, skin, part)
        for part in np.array_split(time_s, -(-time_s.size // _CHUNK))
    ]
    return IdealReadings(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _readings_of(
    session: FieldSession, around: AmbientFields, unit: UnitErrors, skin: Skin, time_s: Floats
) -> IdealReadings:
    steps = np.arange(-REACH, REACH + 1) * STEP_S
    times = time_s[:, None] + steps
    root_rotation, root_place = sensor_pose(session, unit, skin, times)
    carrier_rotation, carrier_place = session.carrier.pose(times)
    rotation = carrier_rotation @ root_rotation
    place = carrier_place + apply(carrier_rotation, root_place)
    here = rotation[:, REACH]
    sensor_from_rest = np.swapaxes(here, -1, -2)
    spin = sensor_from_rest @ first_derivative(rotation)
    gyro = 0.5 * np.stack(
        [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]], axis=-1
    )
    force = second_derivative(place) + around.gravity_m_s2 * around.up
    field = apply(sensor_from_rest, around.field_ut)
    boat = session.boat(time_s)
    iron = around.iron_field(apply(np.swapaxes(boat[0], -1, -2), root_place[:, REACH] - boat[1]))
    field = field + apply(np.swapaxes(root_rotation[:, REACH], -1, -2) @ boat[0], iron)
    return IdealReadings(gyro, apply(sensor_from_rest, force), field)


def sensor_pose(session: FieldSession, unit: UnitErrors, skin: Skin, time_s: Floats) -> tuple[Floats, Floats]:
    """Rotation (..., 3, 3), root from sensor, and position (..., 3) of a unit in root axes at times (...)."""
    posture = np.asarray(session.spline(time_s))
    rotation, origin = session.anatomy.bone(unit.frame, unit.offset_m, posture)
    shift, turn = skin.at(time_s)
    place = origin + apply(rotation, unit.offset_m + shift)
    return rotation @ rotation_by(turn) @ unit.link_from_sensor, place


def first_derivative(values: Floats) -> Floats:
    """Derivative (N, ...) of values (N, 9, ...) at intervals of 2 ms, at their middle; per s."""
    ahead, behind = values[:, REACH + 1 :], values[:, REACH - 1 :: -1]
    return np.asarray(np.einsum("k,nk...->n...", _FIRST / STEP_S, ahead - behind))


def second_derivative(values: Floats) -> Floats:
    """Second derivative (N, ...) of values (N, 9, ...), per s2; differences from the middle avoid rounding errors."""
    here = values[:, REACH]
    ahead, behind = values[:, REACH + 1 :], values[:, REACH - 1 :: -1]
    return np.asarray(
        np.einsum("k,nk...->n...", _SECOND / STEP_S**2, (ahead - here[:, None]) + (behind - here[:, None]))
    )
