"""Constant errors of a simulated field session: lengths, rig, mounts, encoders, magnetometers, biases, clocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.model import ImuDescription, ModelDescription
from oarlock.rowing.field.anatomy import rotation_by
from oarlock.rowing.field.courses import generator
from oarlock.rowing.field.effects import FieldEffects
from oarlock.storage.arrays import Floats


@dataclass(frozen=True, eq=False)
class UnitErrors:
    """Mount and constant errors of one inertial unit.

    ``link_from_sensor`` (3, 3) and ``offset_m`` (3,) are its true mount. Its magnetometer reads ``field_gain`` (3, 3)
    times the field plus ``hard_iron_ut`` (3,). Biases and gains (3,) are those of gyroscope and accelerometer.
    """

    frame: str
    link_from_sensor: Floats
    offset_m: Floats
    field_gain: Floats
    hard_iron_ut: Floats
    gyro_bias_rad_s: Floats
    accel_bias_m_s2: Floats
    gyro_gain: Floats
    accel_gain: Floats


@dataclass(frozen=True)
class SimulatedClock:
    """A stream's clock: it shows ``time_s * (1 + drift) + offset_s`` when the true time is ``time_s``."""

    offset_s: float = 0.0
    drift: float = 0.0

    def shown(self, time_s: Floats) -> Floats:
        """Time stamps of the clock at true times."""
        return time_s * (1.0 + self.drift) + self.offset_s

    def true(self, shown_s: Floats) -> Floats:
        """True times for time stamps of the clock."""
        return (shown_s - self.offset_s) / (1.0 + self.drift)


@dataclass(frozen=True)
class Encoder:
    """An encoder reads ``value * (1 + scale) + offset`` (m or rad)."""

    offset: float = 0.0
    scale: float = 0.0


def true_parameters(description: ModelDescription, effects: FieldEffects, seed: int) -> dict[str, float]:
    """True parameters of athlete and boat that differ from the model's.

    Lengths of the body differ by a share, pins and inboards by a length, each with a random sign.
    """
    rng = generator(seed, "lengths")
    true = {}
    for parameter in description.parameters:
        name, value, sign = parameter.name, float(parameter.value), rng.choice([-1.0, 1.0])
        if parameter.unit != "m":
            continue
        if name.startswith("l_") and not name.startswith(("l_oar", "l_pin")):
            true[name] = value * (1.0 + sign * effects.length_error)
        else:
            true[name] = value + sign * effects.rig_error_m
    return {p.name: true[p.name] for p in description.parameters if true.get(p.name, p.value) != p.value}


def placed_unit(
    sensor: ImuDescription, effects: FieldEffects, condition_bias: tuple[float, float], seed: int
) -> UnitErrors:
    """One unit of a description (with the true lengths), with random errors from the seed.

    The condition's biases are on every axis, as in the paper's experiment; biases of the effects are added.
    """
    rng = generator(seed, f"unit {sensor.name}")
    mount = sensor.mount
    turned, shifted, iron = (direction(rng) for _ in range(3))
    signs = rng.choice([-1.0, 1.0], (4, 3))
    return UnitErrors(
        frame=sensor.frame,
        link_from_sensor=rotation_by(effects.mount_error_rad * turned) @ np.asarray(mount.rotation),
        offset_m=np.asarray(mount.offset) + effects.mount_offset_m * shifted,
        field_gain=_soft_iron(rng, effects.soft_iron),
        hard_iron_ut=effects.hard_iron_ut * iron,
        gyro_bias_rad_s=condition_bias[0] + effects.gyro_bias_rad_s * signs[0],
        accel_bias_m_s2=condition_bias[1] + effects.accel_bias_m_s2 * signs[1],
        gyro_gain=1.0 + effects.gyro_scale * signs[2],
        accel_gain=1.0 + effects.accel_scale * signs[3],
    )


def clock(name: str, effects: FieldEffects, seed: int) -> SimulatedClock:
    """The clock of one inertial unit."""
    offset, drift = generator(seed, f"clock {name}").choice([-1.0, 1.0], 2)
    return SimulatedClock(float(offset * effects.clock_offset_s), float(drift * effects.clock_drift))


def encoder(name: str, slide: bool, effects: FieldEffects, seed: int) -> Encoder:
    """The encoder of a seat (``slide``) or of an oar."""
    offset, scale = generator(seed, f"encoder {name}").choice([-1.0, 1.0], 2)
    strengths = (
        (effects.seat_offset_m, effects.seat_scale) if slide else (effects.oar_offset_rad, effects.oar_scale)
    )
    return Encoder(float(offset * strengths[0]), float(scale * strengths[1]))


def direction(rng: np.random.Generator) -> Floats:
    """A random unit vector (3,), uniform on the sphere."""
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def _soft_iron(rng: np.random.Generator, strength: float) -> Floats:
    """A random symmetric matrix (3, 3) whose largest relative change of length is the strength."""
    axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    stretches = rng.uniform(-1.0, 1.0, 3)
    stretches /= np.abs(stretches).max()
    return np.asarray(np.eye(3) + strength * (axes * stretches) @ axes.T)
