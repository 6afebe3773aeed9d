"""Applies a calibration's corrections to recordings. Used by searches and evaluations that read values directly.

The engine applies the same corrections itself: it takes recordings and samples as measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from oarlock import _core
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock, EncoderScale
from oarlock.recording.streams import ImuStream, OrientationStream, ScalarStream, Stream, VectorStream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

Fields = Mapping[str, Floats]


class Corrections(Protocol):
    """The fields of `oarlock.Calibration` that change readings or stamps."""

    @property
    def gyro_biases_rad_s(self) -> Fields: ...
    @property
    def accel_biases_m_s2(self) -> Fields: ...
    @property
    def accel_scales(self) -> Fields: ...
    @property
    def mag_matrices(self) -> Fields: ...
    @property
    def mag_offsets_ut(self) -> Fields: ...
    @property
    def clocks(self) -> Mapping[str, Clock]: ...
    @property
    def encoders(self) -> Mapping[str, EncoderScale]: ...


OF_UNITS = {
    "gyro_biases_rad_s": "gyro_rad_s",
    "accel_biases_m_s2": "accel_m_s2",
    "accel_scales": "accel_m_s2",
    "mag_matrices": "mag_ut",
}
"""Field of a calibration -> quantity of an inertial unit that it corrects."""

CORRECTING = (*OF_UNITS, "clocks", "encoders")
"""Fields that change readings or time stamps, except `mag_offsets_ut`."""

TOLD = {
    "gyro_biases_rad_s": "gyroscope biases of {} were subtracted",
    "accel_biases_m_s2": "accelerometer biases of {} were subtracted",
    "accel_scales": "accelerometers of {} were scaled",
    "mag_matrices": "soft iron of {} was corrected",
    "clocks": "clocks of {} were corrected",
    "encoders": "zero and scale of {} were applied",
    "mag_offsets_ut": "magnetometer offsets of {} were subtracted",
}


def corrected(recording: Recording, calibration: Corrections | None) -> Recording:
    """The corrected recording, see `oarlock.Calibration.corrected`. Without a calibration: the recording itself."""
    if calibration is None:
        return recording
    streams = [_corrected_stream(stream, calibration) for stream in recording]
    if all(new is old for new, old in zip(streams, recording, strict=True)):
        return recording
    return Recording(streams, recording.meta)


def true_readings(calibration: Corrections, unit: str, field: str, readings: Floats) -> Floats:
    """Readings (T, 3) of one quantity of an inertial unit as the engine uses them, magnetometer offsets subtracted."""
    found = _core.corrected_readings(calibration, unit, field, readings)
    return readings if found is None else found


def without_mag_offsets(recording: Recording, calibration: Corrections | None) -> Recording:
    """The recording with `mag_offsets_ut` subtracted, for code that reads magnetometers without the engine."""
    offsets = {} if calibration is None else calibration.mag_offsets_ut
    streams: list[Stream] = []
    for stream in recording:
        if isinstance(stream, ImuStream) and stream.mag_ut is not None and stream.name in offsets:
            values = dict(stream.values) | {"mag_ut": stream.mag_ut - offsets[stream.name]}
            stream = ImuStream(stream.name, stream.time_s, **values)
        streams.append(stream)
    return Recording(streams, recording.meta)


def correction_notes(recording: Recording, calibration: Corrections | None) -> tuple[str, ...]:
    """One sentence for each field of the calibration that changes readings or time stamps of this recording."""
    if calibration is None:
        return ()
    notes = []
    for field, text in TOLD.items():
        names = [name for name in getattr(calibration, field) if name in recording]
        if names:
            notes.append(text.format(", ".join(names)))
    return tuple(notes)


def as_measured(recording: Recording, calibration: Corrections | None) -> Recording:
    """True readings and times with the errors of a calibration: the inverse of `corrected`, and of the offsets."""
    if calibration is None:
        return recording
    return Recording([_measured_stream(stream, calibration) for stream in recording], recording.meta)


def _measured_stream(stream: Stream, calibration: Corrections) -> Stream:
    name, clock = stream.name, calibration.clocks.get(stream.name)
    time_s = stream.time_s if clock is None else clock.stamps_s(stream.time_s)
    encoder = calibration.encoders.get(name)
    if isinstance(stream, ImuStream):
        accel_scale = calibration.accel_scales.get(name, np.ones(3))
        soft_iron = np.linalg.inv(calibration.mag_matrices.get(name, np.eye(3)))
        errors = {
            "gyro_rad_s": (np.eye(3), calibration.gyro_biases_rad_s),
            "accel_m_s2": (np.diag(accel_scale), calibration.accel_biases_m_s2),
            "mag_ut": (soft_iron, calibration.mag_offsets_ut),
        }
        values = {
            f: v @ errors[f][0].T + errors[f][1].get(name, np.zeros(3)) for f, v in stream.values.items()
        }
        return ImuStream(name, time_s, **values)
    if isinstance(stream, ScalarStream) and encoder is not None:
        return ScalarStream(name, time_s, stream.value / encoder.scale + encoder.zero, stream.unit)
    return replace(stream, time_s=time_s)


def _corrected_stream(stream: Stream, calibration: Corrections) -> Stream:
    for field in OF_UNITS:
        if stream.name in getattr(calibration, field) and not isinstance(stream, ImuStream):
            raise DataError(
                f'calibration, {field} of "{stream.name}": the recording\'s stream of that name is a '
                f"{type(stream).__name__}, not an inertial unit. Rename one of them"
            )
    if stream.name in calibration.encoders and not isinstance(stream, ScalarStream):
        raise DataError(
            f'calibration, encoders of "{stream.name}": the recording\'s stream of that name is a '
            f"{type(stream).__name__}, not a ScalarStream. Rename one of them"
        )
    clock = calibration.clocks.get(stream.name)
    time_s = stream.time_s if clock is None else clock.true_s(stream.time_s)
    if isinstance(stream, ImuStream):
        return _corrected_unit(stream, time_s, calibration)
    encoder = calibration.encoders.get(stream.name)
    if clock is None and encoder is None:
        return stream
    if isinstance(stream, VectorStream | OrientationStream):
        return replace(stream, time_s=time_s)
    value = stream.value if encoder is None else encoder.value(stream.value)
    return ScalarStream(stream.name, time_s, value, stream.unit)


def _corrected_unit(stream: ImuStream, time_s: Floats, calibration: Corrections) -> ImuStream:
    name = stream.name
    corrected = {f: _corrected_values(name, f, v, calibration) for f, v in stream.values.items()}
    same = time_s is stream.time_s and all(corrected[f] is v for f, v in stream.values.items())
    return stream if same else ImuStream(name, time_s, **corrected)


def _corrected_values(unit: str, field: str, values: Floats, calibration: Corrections) -> Floats:
    if field == "mag_ut" and unit not in calibration.mag_matrices:
        return values
    found = true_readings(calibration, unit, field, values)
    # The offset remains in the readings, because `mag_offsets_ut` applies to the corrected recording too.
    kept = calibration.mag_offsets_ut.get(unit) if field == "mag_ut" else None
    return found if kept is None else found + kept
