"""`track_orientations`: an orientation filter for each inertial unit, then inverse kinematics."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock import _core
from oarlock.calibration.static.worn_model import Worn
from oarlock.evaluation.comparison.direct_readings import direct_readings
from oarlock.evaluation.comparison.filter_names import ORIENTATION_FILTERS
from oarlock.evaluation.comparison.inverse_kinematics import Measured, solve
from oarlock.evaluation.comparison.orientation_filters import madgwick, quaternion_ekf, vqf
from oarlock.evaluation.comparison.quest_filter import quest_ekf
from oarlock.evaluation.comparison.single_units import OrientationFilter, UnitSegment, orientations, stretches
from oarlock.evaluation.comparison.vector_filter import vector_kf
from oarlock.model.description import ImuDescription
from oarlock.model.rotation import quat_from_matrix, quat_inverse, quat_product
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected, correction_notes
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, shown
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.known_streams import known_streams
from oarlock.tracking.track import Track, track_without_filter
from oarlock.tracking.tracking import admit
from oarlock.tracking.turns import hinges_of, placed

if TYPE_CHECKING:
    from oarlock._core import Model


FILTERS: Mapping[str, OrientationFilter] = dict(
    zip(ORIENTATION_FILTERS, (vqf, madgwick, quaternion_ekf, quest_ekf, vector_kf), strict=True)
)


def track_orientations(
    model: Model,
    recording: Recording,
    filter: str = "vqf",
    calibration: Calibration | None = None,
    *,
    progress: Progress = None,
) -> Track:
    """Track with one orientation filter per inertial unit, followed by inverse kinematics on the tree.

    This is the common method before filters of whole bodies, for comparison. Units are independent of each other.
    Lengths, lever arms, closures and base accelerations are not used, and biases only if the filter estimates them.
    Encoders are read directly. The heading is that of the model's world, because the filters cannot estimate it.
    Standard deviations, rates and accelerations are not estimated and are NaN.

    Args:
        model: the body and its sensors.
        recording: measured streams; all three quantities of a unit are required.
        filter: vqf, madgwick, quaternion_ekf, quest_ekf or vector_kf.
        calibration: lengths, mounts and magnetometer offsets of this session.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        A track at the time stamps of the unit with the most readings. `provenance` contains the times of filter and
        inverse kinematics, s: `filter_wall_s`, `kinematics_wall_s`, and the same with `cpu`.

    Raises:
        DataError: no such filter, its package is not installed, or no unit has gyroscope, accelerometer and
        magnetometer.
    """
    if filter not in FILTERS:
        known = list(FILTERS)
        raise DataError(f"track_orientations: no filter '{filter}'. {did_you_mean(filter, known)}")
    recording, others = known_streams(model, recording)
    corrections = (*others, *correction_notes(recording, calibration))
    recording = corrected(recording, calibration)
    findings = admit(model, recording)
    worn = Worn.of(model, calibration)
    units, notes = _complete_units(worn, recording)
    began = time.perf_counter()
    found: dict[str, list[tuple[UnitSegment, Floats]]] = {}
    spent_s = np.zeros(2)
    with shown(progress, "filtering units") as told:
        for i, (name, unit) in enumerate(units.items()):
            found[name], took_s = _filtered(unit, FILTERS[filter], worn.model)
            spent_s += took_s
            if told is not None:
                told((i + 1) / len(units))
    time_s = max((unit.stream.time_s for unit in units.values()), key=len)
    measured = _measured(worn, recording, units, found, time_s)
    began_kinematics = time.perf_counter(), time.thread_time()
    q, _ = solve(worn.model, measured, time_s)
    hinges = hinges_of(worn.model.describe().joints, worn.model.coordinate_names)
    q = placed(hinges, q, lambda: np.zeros_like(q), time_s)
    ended, ended_cpu = time.perf_counter(), time.thread_time()
    provenance = {
        "oarlock": _core.__version__,
        "model": model.name,
        "parameters": dict(worn.model.parameters),
        **({} if recording.epoch is None else {"epoch": recording.epoch}),
        "config": {"filter": filter},
        "nominal_mounts": [n for n in units if calibration is None or n not in calibration.mounts],
        "steps": len(time_s),
        "wall_s": ended - began,
        "steps_per_s": len(time_s) / (ended - began),
        "filter_wall_s": float(spent_s[0]),
        "filter_cpu_s": float(spent_s[1]),
        "kinematics_wall_s": ended - began_kinematics[0],
        "kinematics_cpu_s": ended_cpu - began_kinematics[1],
    }
    all_notes = (
        *_filter_notes(model, filter),
        *notes,
        *corrections,
        *(f"{f.sensor}: {f.message}" for f in findings),
    )
    return track_without_filter(worn.model, time_s, q, provenance=provenance, notes=all_notes)


@dataclass(frozen=True, eq=False)
class _InertialUnit:
    """An inertial unit: its stream without the magnetometer's offset, the frame it sits on, link-from-sensor, noise."""

    stream: ImuStream
    frame: str
    link_from_sensor: Floats
    gyro_std_rad_s: float


def _complete_units(worn: Worn, recording: Recording) -> tuple[dict[str, _InertialUnit], list[str]]:
    units: dict[str, _InertialUnit] = {}
    notes = []
    for sensor in worn.model.describe().inertial_units:
        name = sensor.name
        stream = next((s for s in recording if s.name == name), None)
        lacks = _lacks(stream, sensor)
        if lacks:
            notes.append(f"{name}: left out because it has no {lacks}, which these filters need")
            continue
        assert isinstance(stream, ImuStream)
        offset = worn.before.mag_offsets_ut.get(name)
        if offset is not None and stream.mag_ut is not None:
            stream = ImuStream(
                name, stream.time_s, stream.gyro_rad_s, stream.accel_m_s2, stream.mag_ut - offset
            )
        rotation = quat_from_matrix(worn.rotations[name])
        units[name] = _InertialUnit(stream, sensor.frame, rotation, sensor.gyro_std_rad_s or 0.0)
    if not units:
        raise DataError(
            "track_orientations: no inertial unit of the model was recorded with gyroscope, accelerometer and "
            f"magnetometer, which give a single unit its heading ({'; '.join(notes) or 'the model has no unit'}). "
            "Use ukf or ekf: they need no magnetometer."
        )
    return units, notes


def _lacks(stream: object, sensor: ImuDescription) -> str:
    if not isinstance(stream, ImuStream):
        return "stream"
    for label, field in (
        ("gyroscope", "gyro_rad_s"),
        ("accelerometer", "accel_m_s2"),
        ("magnetometer", "mag_ut"),
    ):
        values = getattr(stream, field)
        if values is None or np.isnan(values).all():
            return label
    return "" if sensor.mag_std_ut is not None else "magnetometer in the model"


def _filtered(
    unit: _InertialUnit, run: OrientationFilter, model: Model
) -> tuple[list[tuple[UnitSegment, Floats]], Floats]:
    """Each stretch with (T, 4) north-west-up from sensor; wall-clock and processor time of the filter alone, s."""
    dip_rad = model.describe().world.magnetic_dip_rad
    prepared = list(stretches(unit.stream, unit.gyro_std_rad_s))
    began = np.array([time.perf_counter(), time.thread_time()])
    found = [(stretch, run(stretch, dip_rad)) for stretch in prepared]
    return found, np.array([time.perf_counter(), time.thread_time()]) - began


def _measured(
    worn: Worn,
    recording: Recording,
    units: Mapping[str, _InertialUnit],
    found: Mapping[str, list[tuple[UnitSegment, Floats]]],
    time_s: Floats,
) -> Measured:
    root = root_from_north_west_up(worn.model)
    by_frame: dict[str, Floats] = {}
    for name, unit in units.items():
        sensor = quat_product(root, orientations(found[name], time_s))
        link = quat_product(sensor, quat_inverse(unit.link_from_sensor))
        if unit.frame in by_frame:
            # with two units on one link the first is used, and the other fills its gaps
            first = by_frame[unit.frame]
            link = np.where(np.isfinite(first), first, link)
        by_frame[unit.frame] = link
    readings, std = direct_readings(worn.model, recording, time_s)
    return Measured(by_frame, readings, reading_std=std)


def root_from_north_west_up(model: Model) -> Floats:
    """Quaternion (4,) from north-west-up to root axes, from the field azimuth of the model."""
    world = model.describe().world
    up, forward = np.asarray(world.up), np.asarray(world.forward)
    azimuth = world.magnetic_azimuth_rad
    north = np.cos(azimuth) * forward + np.sin(azimuth) * np.cross(up, forward)
    return quat_from_matrix(np.column_stack([north, np.cross(up, north), up]))


def _filter_notes(model: Model, filter: str) -> tuple[str, ...]:
    described = model.describe()
    unused = [
        *(c.name for c in described.closures),
        *(b.name for b in described.base_acceleration),
    ]
    texts = (
        f"{filter}: one filter for each inertial unit, then inverse kinematics; no standard deviations are estimated",
        "the azimuth of the magnetic field is the model's, not estimated",
    )
    return (*texts, f"not used: {', '.join(unused)}") if unused else texts
