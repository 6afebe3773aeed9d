"""`simulate`: sensor signals of any model along any motion, independent of the filter's measurement model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock import _core
from oarlock._core import Model
from oarlock.model.description import (
    ImuDescription,
    OrientationDescription,
    PositionDescription,
    RangeDescription,
    SensorDescription,
)
from oarlock.recording.corrections import as_measured
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, OrientationStream, ScalarStream, Stream, VectorStream
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.memory_limit import check_memory
from oarlock.storage.progress import Progress, shown
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.track import Track, track_without_filter

if TYPE_CHECKING:
    from oarlock.recording.calibration import Calibration
    from oarlock.simulation.motion import Motion


STENCIL = 9
STEP_S = 2e-3
"""Spacing of the differentiated poses, s: rounding and truncation errors are both near 1e-9 of a limb's signals."""
READINGS, ARRAYS = 9, 9
"""Numbers that a sample keeps at least: readings of a sensor, and arrays of a coordinate (values and rates)."""


def simulate(
    model: Model,
    motion: Motion,
    sensors: Iterable[str] | None = None,
    seed: int = 0,
    *,
    rate_hz: float = 125.0,
    calibration: Calibration | None = None,
    noise: bool | Mapping[str, Mapping[str, float]] = True,
    gyro_bias_rad_s: Mapping[str, Any] | float = 0.0,
    accel_bias_m_s2: Mapping[str, Any] | float = 0.0,
    azimuth_rad: float | None = None,
    heading_rad: Mapping[str, float] | float = 0.0,
    progress: Progress = None,
) -> tuple[Track, Recording]:
    """Simulate the sensors of a body along a motion.

    Args:
        model: defines frames, mounts and noise.
        motion: joint values and the root's acceleration.
        sensors: sensors and input joints; None: all.
        seed: of the noise.
        rate_hz: of all sensors.
        calibration: true lengths and mounts, if they differ from the model's, and errors of readings and clocks.
        noise: of the model file (True), none (False), or by sensor `{"back": {"gyro_rad_s": 0.01}}`.
        gyro_bias_rad_s: of every axis of every unit, or by sensor a number or (3,).
        accel_bias_m_s2: the same for accelerometers.
        azimuth_rad: of the magnetic field; None: the model's.
        heading_rad: rotation of the references of orientation sensors about the vertical, or by sensor.
        progress: True shows that it runs.

    Returns:
        Ground truth, with standard deviations NaN, and recording.

    Raises:
        DataError: an unknown sensor, or a joint that the motion lacks.
    """
    _check_settings(model, noise, gyro_bias_rad_s, accel_bias_m_s2)
    if calibration is not None and calibration.parameters:
        model = model.with_parameters(calibration.parameters)
    time_s = _stamps(model, motion, rate_hz)
    truth = _truth(model, motion, time_s)
    names = _chosen(model, sensors)
    world = model.describe().world
    azimuth = world.magnetic_azimuth_rad if azimuth_rad is None else azimuth_rad
    with shown(progress, "simulating"):
        signals = _imu_signals(model, motion, time_s, calibration, azimuth)
    random = np.random.default_rng(seed)
    streams: list[Stream] = []
    described = {s.name: s for s in model.describe().sensors}
    units = [name for name, s in described.items() if isinstance(s, ImuDescription)]
    for name in names:
        sensor = described.get(name)
        if isinstance(sensor, ImuDescription):
            clean = signals[:, units.index(name)]
            gyro_bias = _bias(gyro_bias_rad_s, "gyro_bias_rad_s", name)
            bias = (gyro_bias, _bias(accel_bias_m_s2, "accel_bias_m_s2", name))
            streams.append(_imu_stream(sensor, time_s, clean, bias, noise, random))
        elif sensor is not None and sensor.kind in _FROM_POSES:
            placement = _Placement(
                calibration, heading_rad.get(name, 0.0) if isinstance(heading_rad, Mapping) else heading_rad
            )
            streams.append(_FROM_POSES[sensor.kind](sensor, truth, noise, random, placement))
        else:
            streams.append(_joint_stream(model, name, sensor, truth, noise, random))
    return truth, as_measured(Recording(streams), calibration)


_NOISE_FIELDS = ("gyro_rad_s", "accel_m_s2", "mag_ut", "quat_wxyz", "value")


def _check_settings(model: Model, noise: bool | Mapping[str, Mapping[str, float]], *biases: Any) -> None:
    names = (*model.sensor_names, *model.joint_names)
    for label, given in (("noise", noise), ("gyro_bias_rad_s", biases[0]), ("accel_bias_m_s2", biases[1])):
        for name in given if isinstance(given, Mapping) else ():
            if name not in names:
                raise DataError(f"simulate, {label}: no sensor '{name}'. {did_you_mean(name, names)}")
    for name, fields in noise.items() if isinstance(noise, Mapping) else ():
        for field in fields:
            if field not in _NOISE_FIELDS:
                hint = did_you_mean(field, _NOISE_FIELDS)
                raise DataError(f"simulate, noise of '{name}': no quantity '{field}'. {hint}")


def _stamps(model: Model, motion: Motion, rate_hz: float) -> Floats:
    if not (rate_hz > 0.0 and np.isfinite(rate_hz)):
        raise DataError(f"simulate: rate_hz = {rate_hz}; expected a positive number of samples per second")
    # The spline's first and last interval leave room for the stencil inside the motion.
    room = STENCIL // 2 * STEP_S
    first, last = motion.start_s + room, motion.end_s - room
    count = int(np.floor((last - first) * rate_hz + 1e-9)) + 1
    if count < 2:
        raise DataError(f"simulate: the motion lasts {last - first:.3f} s, too short for {rate_hz} Hz")
    numbers = READINGS * len(model.sensor_names) + ARRAYS * len(model.coordinate_names)
    check_memory(
        8.0 * count * numbers,
        f"simulate: {last - first:g} s at {rate_hz:g} Hz",
        "Simulate a shorter motion, or at a lower rate.",
    )
    return np.asarray(first + np.arange(count) / rate_hz)


def _arranged(model: Model, motion: Motion, values: Floats) -> Floats:
    missing = [c for c in model.coordinate_names if c not in motion.coordinate_names]
    if missing:
        raise DataError(f"simulate: the motion has no values for {', '.join(missing)}")
    order = [motion.coordinate_names.index(c) for c in model.coordinate_names]
    return np.asarray(values[..., order])


def _truth(model: Model, motion: Motion, time_s: Floats) -> Track:
    q, qd, qdd = (_arranged(model, motion, x) for x in motion.derivatives(time_s))
    provenance = {
        "oarlock": _core.__version__,
        "model": model.name,
        "parameters": model.parameters,
        "simulated": True,
    }
    return track_without_filter(model, time_s, q, qd, qdd, provenance=provenance)


def _chosen(model: Model, sensors: Iterable[str] | None) -> list[str]:
    own = list(model.sensor_names)
    encoded = {s.joint for s in model.describe().encoders}
    inputs = [j.name for j in model.describe().inputs if j.name not in encoded]
    if sensors is None:
        return own
    chosen = list(sensors)
    for name in chosen:
        if name not in own + inputs:
            raise DataError(f"simulate: the model has no sensor '{name}'. {did_you_mean(name, own + inputs)}")
    return chosen


def _imu_signals(
    model: Model, motion: Motion, time_s: Floats, calibration: Calibration | None, azimuth_rad: float
) -> Floats:
    around = (np.arange(STENCIL) - STENCIL // 2) * STEP_S
    q = _arranged(model, motion, motion.at(time_s[:, None] + around))
    base = motion.base_acceleration_at(time_s)
    return _core.imu_signals(model, calibration, q, STEP_S, base, azimuth_rad)


def _bias(given: Mapping[str, Any] | float, label: str, name: str) -> Floats:
    value = given.get(name, 0.0) if isinstance(given, Mapping) else given
    if np.shape(value) not in ((), (3,)):
        shape = np.shape(value)
        raise DataError(f"simulate, {label} of '{name}': shape {shape}; expected one number or three")
    return np.broadcast_to(real_array(value, np.shape(value), f"simulate, {label} of '{name}'"), (3,))


def _std(noise: bool | Mapping[str, Mapping[str, float]], name: str, field: str, own: float) -> float:
    if isinstance(noise, Mapping):
        return float(noise.get(name, {}).get(field, own))
    return own if noise else 0.0


def _imu_stream(
    sensor: ImuDescription,
    time_s: Floats,
    clean: Floats,
    bias: tuple[Floats, Floats],
    noise: bool | Mapping[str, Mapping[str, float]],
    random: np.random.Generator,
) -> ImuStream:
    fields: dict[str, Floats | None] = {}
    quantities = (
        ("gyro_rad_s", sensor.gyro_std_rad_s, bias[0]),
        ("accel_m_s2", sensor.accel_std_m_s2, bias[1]),
        ("mag_ut", sensor.mag_std_ut, np.zeros(3)),
    )
    for i, (field, own, offset) in enumerate(quantities):
        if own is not None:
            std = _std(noise, sensor.name, field, own)
            values = clean[:, 3 * i : 3 * i + 3] + offset
            fields[field] = values + std * random.standard_normal(values.shape)
    return ImuStream(sensor.name, time_s, **fields)


@dataclass(frozen=True)
class _Placement:
    """True mounts, and the heading of an orientation sensor's reference."""

    calibration: Calibration | None
    heading_rad: float


def _pose(truth: Track, frame: str) -> Floats:
    assert truth.model is not None
    return truth.model.forward_kinematics(truth.q)[:, truth.model.frame_names.index(frame)]


def _point(truth: Track, frame: str, point: Any) -> Floats:
    pose = _pose(truth, frame)
    return np.asarray(pose[:, :3, 3] + pose[:, :3, :3] @ np.asarray(point))


def _position_stream(
    sensor: PositionDescription,
    truth: Track,
    noise: bool | Mapping[str, Mapping[str, float]],
    random: np.random.Generator,
    _: _Placement,
) -> VectorStream:
    point = _point(truth, sensor.frame, sensor.point)
    std = _std(noise, sensor.name, "value", sensor.std_m)
    return VectorStream(sensor.name, truth.time_s, point + std * random.standard_normal(point.shape))


def _range_stream(
    sensor: RangeDescription,
    truth: Track,
    noise: bool | Mapping[str, Mapping[str, float]],
    random: np.random.Generator,
    _: _Placement,
) -> ScalarStream:
    first = _point(truth, sensor.frame_a, sensor.point_a)
    distance = np.linalg.norm(first - _point(truth, sensor.frame_b, sensor.point_b), axis=1)
    std = _std(noise, sensor.name, "value", sensor.std_m)
    value = distance + std * random.standard_normal(distance.shape)
    return ScalarStream(sensor.name, truth.time_s, value, "m")


def _orientation_stream(
    sensor: OrientationDescription,
    truth: Track,
    noise: bool | Mapping[str, Mapping[str, float]],
    random: np.random.Generator,
    placement: _Placement,
) -> OrientationStream:
    """Orientations of a device whose filter has a slow Gauss-Markov error and white noise."""
    given = {} if placement.calibration is None else dict(placement.calibration.mounts)
    link_from_sensor = given[sensor.name][0] if sensor.name in given else sensor.mount.rotation
    reference_from_root = Rotation.from_matrix(sensor.root_from_reference).inv()
    root_from_sensor = Rotation.from_matrix(
        _pose(truth, sensor.frame)[:, :3, :3] @ np.asarray(link_from_sensor)
    )
    correlation_time_s = sensor.correlation_time_s
    scale = _std(noise, sensor.name, "quat_wxyz", sensor.std_rad) / sensor.std_rad
    white_std = scale * (sensor.white_std_rad if correlation_time_s > 0.0 else sensor.std_rad)
    slow_std = scale * sensor.std_rad if correlation_time_s > 0.0 else 0.0
    errors = white_std * random.standard_normal((len(truth.time_s), 3))
    errors += slow_std * _gauss_markov(truth.time_s, correlation_time_s, random)
    turned = Rotation.from_rotvec([0.0, 0.0, placement.heading_rad])
    measured = turned * reference_from_root * root_from_sensor * Rotation.from_rotvec(errors)
    return OrientationStream(sensor.name, truth.time_s, measured.as_quat(scalar_first=True))


def _gauss_markov(time_s: Floats, correlation_time_s: float, random: np.random.Generator) -> Floats:
    """A Gauss-Markov process (T, 3) of unit variance with the time constant `correlation_time_s`."""
    kept = (
        np.exp(-np.diff(time_s) / correlation_time_s)
        if correlation_time_s > 0.0
        else np.zeros(len(time_s) - 1)
    )
    fresh = random.standard_normal((len(time_s), 3))
    values = [fresh[0]]
    for keep, new in zip(kept, fresh[1:], strict=True):
        values.append(keep * values[-1] + np.sqrt(1.0 - keep * keep) * new)
    return np.array(values)


_FROM_POSES: Mapping[str, Callable[..., Stream]] = {
    "position": _position_stream,
    "range": _range_stream,
    "orientation": _orientation_stream,
}
"""Sensors that read only poses."""


def _joint_stream(
    model: Model,
    name: str,
    sensor: SensorDescription | None,
    truth: Track,
    noise: bool | Mapping[str, Mapping[str, float]],
    random: np.random.Generator,
) -> ScalarStream:
    joint = name if sensor is None or sensor.joint is None else sensor.joint
    described = next(j for j in model.describe().joints if j.name == joint)
    own = described.std if described.input else sensor and sensor.std
    value = truth.scalar(joint).value
    std = _std(noise, name, "value", own or 0.0)
    return ScalarStream(name, truth.time_s, value + std * random.standard_normal(value.shape))
