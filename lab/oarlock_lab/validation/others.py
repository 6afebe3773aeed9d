"""Other software on the same recordings, as it comes: default settings, unless a line here says otherwise.

Every package is optional (requirements/validation.txt pins those that were compared); `estimate.attempt` turns a
missing one into a line of the table. World axes: z up; with magnetometer x east, y north.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from oarlock import Recording
from oarlock.recording import ImuStream
from oarlock.storage.arrays import Floats

from .estimate import NotRunError, OrientationEstimate

GRAVITY_M_S2 = 9.80665

VQF_WITHOUT_MAG = ("VQF 6D", "VQF 6D offline")
VQF_NAMES = (*VQF_WITHOUT_MAG, "VQF 9D", "VQF 9D offline")
IMUFUSION_WITHOUT_MAG = ("imufusion 6D",)
IMUFUSION_NAMES = (*IMUFUSION_WITHOUT_MAG, "imufusion 9D")

# Of the package's advanced example (Python/advanced_example.py); the defaults leave the rejections out.
IMUFUSION_SETTINGS = {
    "gain": 0.5,
    "acceleration_rejection": 10.0,
    "magnetic_rejection": 20.0,
    "rejection_timeout": 5.0,
}

DFJIMU_NAMES = ("dfjimu MEKF", "dfjimu MAP")

# The example script of dfjimu uses these covariances for its offline solver, which has no defaults.
MAP_GYRO_COVARIANCE = 0.01
MAP_INCLINATION_COVARIANCE = 0.1
MAP_LINK_COVARIANCE = 1.0


def versions() -> dict[str, str]:
    """Package -> installed version, or "not installed"."""
    numbers = {}
    for package in ("vqf", "imufusion", "dfjimu", "biorbd", "opensim"):
        try:
            numbers[package] = version(package)
        except ImportError:
            numbers[package] = "not installed"
    return numbers


def at_rows(recording: Recording) -> Recording:
    """The readings stamped with their rows' times: half a step later, where each interval ends.

    Software that turns by a reading for a whole step arrives there; its users set its rows beside those of the file.
    """
    streams = [
        ImuStream(
            s.name,
            s.time_s + 0.5 / s.rate_hz,
            gyro_rad_s=s.gyro_rad_s,
            accel_m_s2=s.accel_m_s2,
            mag_ut=s.mag_ut,
        )
        for s in _units(recording)
    ]
    return Recording(streams, recording.meta)


def vqf(recording: Recording, names: Sequence[str] = VQF_NAMES) -> Iterator[OrientationEstimate]:
    """VQF (Laidig and Seel 2023), each unit by itself, causal and offline."""
    from vqf import VQF, offlineVQF

    for name in names:
        key = "quat9D" if "9D" in name else "quat6D"
        quats = {}
        for stream in _units(recording):
            gyro, accel, mag = _readings(stream, magnetic="9D" in name)
            step_s = 1.0 / stream.rate_hz
            algorithm = (
                offlineVQF(gyro, accel, mag, step_s)
                if "offline" in name
                else VQF(step_s).updateBatch(gyro, accel, mag)
            )
            quats[stream.name] = np.asarray(algorithm[key])
        yield OrientationEstimate(name, recording.streams[0].time_s, quats, online="offline" not in name)


def imufusion(recording: Recording, names: Sequence[str] = IMUFUSION_NAMES) -> Iterator[OrientationEstimate]:
    """Fusion of x-io (revised Madgwick filter), each unit by itself, set up as its advanced example does."""
    from imufusion import CONVENTION_ENU, Ahrs, AhrsSettings, Bias, BiasSettings

    for name in names:
        quats = {}
        for stream in _units(recording):
            gyro, accel, mag = _readings(stream, magnetic="9D" in name)
            filter_, bias = Ahrs(), Bias()
            settings = AhrsSettings(
                sample_rate=stream.rate_hz, convention=CONVENTION_ENU, **IMUFUSION_SETTINGS
            )
            filter_.set_settings(settings)
            bias.set_settings(BiasSettings(sample_rate=stream.rate_hz))
            gyro_deg_s, pulled_g = np.degrees(gyro), accel / GRAVITY_M_S2
            rows = np.empty((len(gyro), 4))
            for i in range(len(gyro)):
                rate_deg_s = bias.update(gyro_deg_s[i])
                if mag is None:
                    filter_.update_no_magnetometer(rate_deg_s, pulled_g[i])
                else:
                    filter_.update(rate_deg_s, pulled_g[i], mag[i])
                rows[i] = filter_.get_quaternion()
            quats[stream.name] = rows
        yield OrientationEstimate(name, recording.streams[0].time_s, quats)


def dfjimu(
    recording: Recording, joint_in_sensor_m: Mapping[str, Sequence[float]]
) -> Iterator[OrientationEstimate]:
    """The two methods of Weygers and Kok 2020 for two units beside a ball joint, given the lever arms.

    Args:
        recording: two units.
        joint_in_sensor_m: stream -> the joint's centre in the axes of the unit, m.
    """
    from dfjimu import map_acc, mekf_acc

    first, second = _units(recording)
    (gyro1, accel1, _), (gyro2, accel2, _) = (_readings(s, magnetic=False) for s in (first, second))
    # The software counts from the joint to the sensor.
    arms = [-np.array(joint_in_sensor_m[s.name], dtype=np.float64) for s in (first, second)]
    readings = (gyro1, gyro2, accel1, accel2, *arms, first.rate_hz, np.array([1.0, 0.0, 0.0, 0.0]))
    covariances = (
        np.eye(6) * MAP_GYRO_COVARIANCE,
        np.eye(3) * MAP_INCLINATION_COVARIANCE,
        np.eye(3) * MAP_LINK_COVARIANCE,
    )
    runs: dict[str, Callable[[], Any]] = {
        "dfjimu MEKF": partial(mekf_acc, *readings),
        "dfjimu MAP": partial(map_acc, *readings, *covariances),
    }
    for name, run in runs.items():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            algorithm = run()
        note = "; ".join(str(w.message).split(";")[0] for w in caught)
        quats = {s.name: np.asarray(q) for s, q in zip((first, second), algorithm, strict=True)}
        yield OrientationEstimate(name, first.time_s, quats, online="MEKF" in name, note=note)


def _units(recording: Recording) -> list[ImuStream]:
    units = [s for s in recording if isinstance(s, ImuStream)]
    for unit in units:
        if not np.array_equal(unit.time_s, units[0].time_s):
            raise NotRunError(f"{unit.name} has other stamps than {units[0].name}")
    return units


def _readings(stream: ImuStream, *, magnetic: bool) -> tuple[Floats, Floats, Floats | None]:
    """Writable, contiguous copies: what is read-only here, others refuse or would change."""
    if stream.gyro_rad_s is None or stream.accel_m_s2 is None:
        raise NotRunError(f"{stream.name} lacks a gyroscope or an accelerometer")
    if np.isnan(stream.gyro_rad_s).any() or np.isnan(stream.accel_m_s2).any():
        raise NotRunError(f"{stream.name} has missing readings")
    if magnetic and stream.mag_ut is None:
        raise NotRunError(f"{stream.name} has no magnetometer")
    mag = np.array(stream.mag_ut) if magnetic else None
    return np.array(stream.gyro_rad_s), np.array(stream.accel_m_s2), mag
