"""Sensor electronics of the field simulator: gain, bias, drift, noise, cut-off, clocks and packet loss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.model import EncoderDescription, ImuDescription
from oarlock.recording import ImuStream, ScalarStream
from oarlock.rowing.field.courses import generator
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.placement import Encoder, UnitErrors
from oarlock.rowing.field.signals import IdealReadings
from oarlock.storage.arrays import Bools, Floats

_MINUTE_S = 60.0
_LARGEST_JITTER = 0.4
"""Largest jitter as a share of the sampling interval, so that time stamps stay in order."""


@dataclass(frozen=True, eq=False)
class SampleTimes:
    """True sampling times of a unit, (N,) s, and its time stamps, (N,) s."""

    time_s: Floats
    stamp_s: Floats


def stamped(name: str, time_s: Floats, shown_s: Floats, effects: FieldEffects, seed: int) -> SampleTimes:
    """Time stamps with jitter of the samples that are not lost; the first and the last are never lost."""
    rng = generator(seed, f"radio {name}")
    jitter = effects.clock_jitter_s * rng.standard_normal(time_s.size)
    arrives = rng.random(time_s.size) >= effects.packet_loss
    arrives[[0, -1]] = True
    most = _LARGEST_JITTER * float(np.diff(shown_s).min()) if time_s.size > 1 else 0.0
    return SampleTimes(time_s[arrives], (shown_s + np.clip(jitter, -most, most))[arrives])


def gap(name: str, units: list[str], time_s: Floats, effects: FieldEffects, seed: int) -> Bools:
    """(N,) True during the dropout of the unit: one unit has one dropout, in the middle half of the recording."""
    rng = generator(seed, "gap")
    chosen = units[int(rng.integers(len(units)))]
    first, last = float(time_s[0]), float(time_s[-1])
    start = first + (last - first) * rng.uniform(0.25, 0.75)
    return np.asarray((time_s >= start) & (time_s < start + effects.gap_s) & (name == chosen))


def read_unit(
    sensor: ImuDescription,
    unit: UnitErrors,
    ideal: IdealReadings,
    sampled: SampleTimes,
    dropout: Bools,
    effects: FieldEffects,
    seed: int,
) -> ImuStream:
    """The stream of one inertial unit; quantities without noise in the model are not measured."""
    name = sensor.name
    rng = generator(seed, f"noise {name}")
    drift = (effects.gyro_drift_rad_s, effects.accel_drift_m_s2)
    gyro = unit.gyro_gain * ideal.gyro_rad_s + unit.gyro_bias_rad_s + walk(rng, sampled.time_s, drift[0])
    accel = unit.accel_gain * ideal.accel_m_s2 + unit.accel_bias_m_s2 + walk(rng, sampled.time_s, drift[1])
    mag = ideal.field_ut @ unit.field_gain.T + unit.hard_iron_ut
    limits = (effects.gyro_range_rad_s, effects.accel_range_m_s2, np.inf)
    stds = (sensor.gyro_std_rad_s, sensor.accel_std_m_s2, sensor.mag_std_ut)
    fields: dict[str, Floats | None] = {}
    for key, clean, limit, std in zip(
        ("gyro_rad_s", "accel_m_s2", "mag_ut"), (gyro, accel, mag), limits, stds, strict=True
    ):
        noise = rng.standard_normal(clean.shape)
        if std is not None:
            values = np.clip(clean + effects.noise_factor * std * noise, -limit, limit)
            fields[key] = np.where(dropout[:, None], np.nan, values)
    return ImuStream(name, sampled.stamp_s, **fields)


def read_encoder(
    sensor: EncoderDescription,
    encoder: Encoder,
    value: Floats,
    time_s: Floats,
    effects: FieldEffects,
    seed: int,
) -> ScalarStream:
    """The stream of one encoder."""
    drawn = generator(seed, f"noise {sensor.name}").standard_normal(value.shape)
    noise = effects.noise_factor * sensor.std * drawn
    return ScalarStream(sensor.name, time_s, value * (1.0 + encoder.scale) + encoder.offset + noise)


def walk(rng: np.random.Generator, time_s: Floats, per_minute: float) -> Floats:
    """A random walk (N, 3) from zero whose standard deviation after a minute is ``per_minute``."""
    steps = rng.standard_normal((time_s.size, 3))
    spread = per_minute * np.sqrt(np.diff(time_s, prepend=time_s[:1]) / _MINUTE_S)
    return np.asarray(np.cumsum(spread[:, None] * steps, axis=0))
