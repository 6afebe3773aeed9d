"""Permanent faults of readings: clipped, exchanged, wrong sign, wrong zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oarlock.evaluation.study.faults.fault import Case, Fault, Names, Spoil, of_streams, of_units, with_values
from oarlock.evaluation.study.keys import ONE, StudyKey, Value
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, Stream
from oarlock.storage.errors import DataError


def readings(names: Names) -> tuple[Fault, ...]:
    """The faults of this module, from electronics and from mounting mistakes."""
    encoders = (*names.angles, *names.lengths)
    clipped = StudyKey(
        "gyro_range_deg_s",
        "by_name",
        0.0,
        "range of gyroscopes; readings beyond it are clipped; 0: no limit",
        0.0,
        choices=(*names.units, ONE),
    )
    swapped = StudyKey(
        "exchanged",
        "names",
        [],
        "exchanged inertial units, in pairs",
        choices=names.units,
    )
    negated = StudyKey("wrong_sign", "names", [], "encoders with the wrong sign", choices=encoders)
    angle = StudyKey(
        "encoder_offset_deg",
        "by_name",
        0.0,
        "error of the zero of angle encoders, with random sign",
        choices=names.angles,
    )
    length = StudyKey(
        "encoder_offset_m",
        "by_name",
        0.0,
        "error of the zero of length encoders, with random sign",
        choices=names.lengths,
    )
    return (
        Fault(clipped, of_units(_clipped, names.units)),
        Fault(swapped, _exchanged),
        Fault(negated, _negated),
        Fault(angle, _offset(names.angles, np.pi / 180.0)),
        Fault(length, _offset(names.lengths, 1.0)),
    )


def _clipped(unit: ImuStream, range_deg_s: float, case: Case) -> ImuStream:
    if unit.gyro_rad_s is None:
        return unit
    most = np.radians(range_deg_s)
    return with_values(unit, gyro_rad_s=np.clip(unit.gyro_rad_s, -most, most))


def _exchanged(recording: Recording, value: Value, case: Case) -> Recording:
    assert isinstance(value, list)
    if len(value) % 2 or len(set(value)) < len(value):
        raise DataError(f"exchanged = {value}: expected pairs of different units, such as two names")
    other = {a: b for pair in zip(value[::2], value[1::2], strict=True) for a, b in (pair, pair[::-1])}
    streams = [_renamed(stream, other.get(stream.name, stream.name)) for stream in recording.streams]
    places = {name: place for place, name in enumerate(recording.names)}
    streams.sort(key=lambda stream: places.get(stream.name, len(places)))
    return Recording(streams, recording.meta)


def _renamed(stream: Stream, name: str) -> Stream:
    return stream if stream.name == name else replace(stream, name=name)


def _negated(recording: Recording, value: Value, case: Case) -> Recording:
    assert isinstance(value, list)
    streams = [
        replace(stream, value=-stream.value)
        if isinstance(stream, ScalarStream) and stream.name in value
        else stream
        for stream in recording.streams
    ]
    return Recording(streams, recording.meta)


def _offset(encoders: tuple[str, ...], factor: float) -> Spoil:
    def moved(stream: Stream, size: float, case: Case) -> Stream:
        if not isinstance(stream, ScalarStream):
            return stream
        return replace(stream, value=stream.value + factor * size * case.sign(f"zero {stream.name}"))

    return of_streams(moved, encoders)
