"""`simulate_session`: a simulated guided session with unknown mounts and sensor errors.

It shares no code with the calibration: signals of the body come from `oarlock.simulate`, which differentiates poses,
those of units on the table from differences of attitudes, and all errors are added here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from oarlock.calibration.session.plan import SessionPlan, default_plan
from oarlock.model.description import ImuDescription, WorldDescription
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import as_measured
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.recording.streams import ImuStream
from oarlock.simulation.motion import Motion
from oarlock.simulation.session_course import PostureErrors, body_course, table_course
from oarlock.simulation.simulate import simulate
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.tracking.track import Track

Skin = Callable[[ImuDescription, Floats, Floats], Floats]


@dataclass(frozen=True)
class SessionErrors:
    """Standard deviations of the errors of a session, drawn for each unit and axis.

    Args:
        mount_rad: mount error of each unit about each axis, rad.
        posture_rad: error of each joint in each posture, also while another joint moves, rad.
        segment_rad: error of the attitude of each segment with a unit, about each axis, in each posture, rad: as far as
            the joints allow, and in addition to `posture_rad`. Errors of joints add up along a chain, these do not.
        sway_rad: slow motion of joints during a posture, rad; four times as large during a movement.
        gyro_bias_rad_s: gyroscope bias of each axis.
        accel_bias_m_s2: accelerometer bias of each axis.
        accel_scale: accelerometer scale error of each axis, as a share.
        hard_iron_ut: magnetometer offset of each axis.
        soft_iron: each entry of a symmetric matrix, as a share.
        clock_offset_s: clock offset of each unit.
        clock_drift: clock drift of each unit, s per s.
        skin_rad: rotation of a unit on its link about each axis, for each radian of a joint's distance from its rest
            posture.
    """

    mount_rad: float = float(np.radians(12.0))
    posture_rad: float = float(np.radians(1.0))
    segment_rad: float = 0.0
    sway_rad: float = float(np.radians(0.2))
    gyro_bias_rad_s: float = 0.02
    accel_bias_m_s2: float = 0.1
    accel_scale: float = 0.005
    hard_iron_ut: float = 15.0
    soft_iron: float = 0.03
    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    skin_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise DataError(f"session errors: {name} = {value}; expected 0 or more")


@dataclass(frozen=True, eq=False)
class SessionTrial:
    """A simulated session.

    Args:
        recording: readings of the sensors.
        truth: motion of the body while units are mounted; true time.
        calibration: true mounts, biases, scales, iron and clocks.
        spans: true interval of each step, (start, end) s.
        plan: the plan.
    """

    recording: Recording
    truth: Track
    calibration: Calibration
    spans: Mapping[str, tuple[float, float]]
    plan: SessionPlan

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the recording with `truth/`, `true_calibration.toml` and `plan.toml`."""
        with replaced_folder(folder, "recording") as place:
            self.recording.save(place)
            self.truth.save(place / "truth")
            self.calibration.save(place / "true_calibration.toml")
            self.plan.save(place / "plan.toml")


def simulate_session(
    model: Model,
    plan: SessionPlan | None = None,
    errors: SessionErrors | None = None,
    *,
    seed: int = 0,
    rate_hz: float = 100.0,
    skin: Skin | None = None,
) -> SessionTrial:
    """Simulate a person who follows the plan of a calibration session.

    Args:
        model: the body with nominal mounts; the simulated mounts differ.
        plan: the steps; None uses the plan that ships with the model. Times in it are ignored.
        errors: errors of postures and sensors; None is a careful person with consumer sensors.
        seed: seed of all random numbers.
        rate_hz: sampling rate of all units, Hz.
        skin: function for the rotation of each unit on its link, in addition to `SessionErrors.skin_rad`: (sensor's
            description, times (K,) s, coordinates (K, n)) -> rotation vectors (K, 3), rad, link axes.

    Raises:
        DataError: the plan does not fit the model.
    """
    plan = default_plan(model) if plan is None else plan
    plan.check(model)
    errors = SessionErrors() if errors is None else errors
    rng = np.random.default_rng([seed, 20])
    description = model.describe()
    units = description.inertial_units
    truth = _true_calibration(units, errors, rng)
    rest = [np.ravel(j.rest) for j in description.joints]
    at_rest = dict(zip(model.coordinate_names, np.concatenate(rest).tolist(), strict=True))
    posture_errors = PostureErrors(model, errors.posture_rad, errors.segment_rad, errors.sway_rad)
    course = body_course(posture_errors, plan, at_rest, rng)
    motion = Motion(tuple(at_rest), course.time_s, course.q)
    names = [s.name for s in units]
    azimuth = float(rng.uniform(-np.pi, np.pi))
    track, clean = simulate(
        model,
        motion,
        names,
        rate_hz=rate_hz,
        calibration=Calibration(mounts=truth.mounts),
        noise=False,
        azimuth_rad=azimuth,
    )
    lying = any(s.kind == "turn" for s in plan.steps)
    tables = {n: table_course(rate_hz, rng) for n in names} if lying else {}
    shift = max((t[-1] for t, _ in tables.values()), default=-1.0 / rate_hz) + 1.0 / rate_hz - track.time_s[0]
    streams = []
    for sensor in units:
        stream = clean[sensor.name]
        assert isinstance(stream, ImuStream)
        ways = errors.skin_rad * rng.normal(0.0, 1.0, (course.q.shape[1], 3))
        turns = (course.q - course.q[0]) @ ways
        if skin is not None:
            turns = turns + skin(sensor, course.time_s, course.q)
        signals = _with_skin(stream, course.time_s, turns @ truth.mounts[sensor.name][0])
        time_s = stream.time_s + shift
        if lying:
            time_s, signals = _after_table(tables[sensor.name], description.world, azimuth, time_s, signals)
        streams.append(_read(sensor, time_s, signals, rng))
    spans = {n: (a + shift, b + shift) for n, (a, b) in course.spans.items()}
    moved = replace(track, time_s=track.time_s + shift)
    recording = as_measured(Recording(streams, {"source": "simulated session", "seed": seed}), truth)
    return SessionTrial(recording, moved, truth, spans, plan)


def _true_calibration(
    units: Sequence[ImuDescription], errors: SessionErrors, rng: np.random.Generator
) -> Calibration:
    """True mounts and errors of each unit."""
    fields: dict[str, dict[str, Any]] = {}

    def put(field: str, unit: str, value: object) -> None:
        fields.setdefault(field, {})[unit] = value

    for sensor in units:
        name, mount = sensor.name, sensor.mount
        turn = Rotation.from_rotvec(rng.normal(0.0, errors.mount_rad, 3)).as_matrix()
        put("mounts", name, (turn @ np.asarray(mount.rotation), np.asarray(mount.offset)))
        put("gyro_biases_rad_s", name, rng.normal(0.0, errors.gyro_bias_rad_s, 3))
        put("accel_biases_m_s2", name, rng.normal(0.0, errors.accel_bias_m_s2, 3))
        put("accel_scales", name, 1.0 + rng.normal(0.0, errors.accel_scale, 3))
        hard = rng.normal(0.0, errors.hard_iron_ut, 3)
        soft = np.triu(rng.normal(0.0, errors.soft_iron, (3, 3)))
        soft = np.eye(3) + soft + np.triu(soft, 1).T
        if sensor.mag_std_ut is not None:
            put("mag_offsets_ut", name, hard)
            put("mag_matrices", name, np.linalg.inv(3.0 * soft / np.trace(soft)))
        clock = rng.normal(0.0, 1.0, 2) * (errors.clock_offset_s, errors.clock_drift)
        if clock.any():
            put("clocks", name, Clock(float(clock[0]), float(clock[1])))
    return Calibration(**fields)


def _with_skin(stream: ImuStream, knots_s: Floats, turns: Floats) -> dict[str, Floats]:
    """The signals of a unit that rotates relative to its mount, by rotation vectors (K, 3) in its own axes."""
    signals = {name: np.array(values) for name, values in stream.values.items()}
    if not turns.any():
        return signals
    fine = np.asarray(make_interp_spline(knots_s, turns, k=5)(stream.time_s))
    turn = Rotation.from_rotvec(fine)
    rates = (turn[:-1].inv() * turn[1:]).as_rotvec() / np.diff(stream.time_s)[:, None]
    signals = {name: turn.inv().apply(values) for name, values in signals.items()}
    signals["gyro_rad_s"] += np.vstack([rates, rates[-1:]])
    return signals


def _after_table(
    table: tuple[Floats, Floats],
    world: WorldDescription,
    azimuth: float,
    time_s: Floats,
    signals: dict[str, Floats],
) -> tuple[Floats, dict[str, Floats]]:
    """Times and signals of a unit that first lies on a table and is then mounted."""
    lying_s, room_from_sensor = table  # z of the room is up, x forward
    strength, dip = world.magnetic_norm_ut, world.magnetic_dip_rad
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    field = strength * (np.cos(dip) * level - np.sin(dip) * np.array([0.0, 0.0, 1.0]))
    turns = Rotation.from_matrix(np.swapaxes(room_from_sensor[:-1], -1, -2) @ room_from_sensor[1:])
    rates = turns.as_rotvec() / np.diff(lying_s)[:, None]
    lying = {
        "gyro_rad_s": np.vstack([rates, rates[-1:]]),
        "accel_m_s2": world.gravity_m_s2 * room_from_sensor[:, 2],
        "mag_ut": np.einsum("tji,j->ti", room_from_sensor, field),
    }
    both = {name: np.vstack([lying[name], values]) for name, values in signals.items()}
    return np.concatenate([lying_s, time_s]), both


def _read(
    sensor: ImuDescription,
    time_s: Floats,
    signals: Mapping[str, Floats],
    rng: np.random.Generator,
) -> ImuStream:
    """Ideal signals of a unit with its noise."""
    noise = {
        "gyro_rad_s": sensor.rest_std_rad_s or sensor.gyro_std_rad_s or 0.0,
        "accel_m_s2": min(sensor.accel_std_m_s2 or 0.0, 0.05),
        "mag_ut": sensor.mag_std_ut or 0.0,
    }
    read = {k: values + rng.normal(0.0, 1.0, values.shape) * noise[k] for k, values in signals.items()}
    return ImuStream(sensor.name, time_s, **read)
