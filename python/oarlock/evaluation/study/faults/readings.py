"""Permanent faults of readings: clipped, exchanged, wrong sign, wrong zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oarlock.evaluation.study.faults.fault import Case, Fault, Names, Spoil, of_streams, of_units, with_values
from oarlock.evaluation.study.keys import ONE, StudyKey, Value, sized
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, Stream
from oarlock.storage.errors import DataError


def readings(names: Names) -> tuple[Fault, ...]:
    """The faults of this module, from electronics and from mounting mistakes."""
    encoders = (*names.angles, *names.lengths)
    units = names.units
    clipped = sized("gyro_range_deg_s", "gyroscopes read no more than this; 0: no limit", (*units, ONE))
    swapped = StudyKey("exchanged", "names", [], "exchanged inertial units, in pairs", choices=units)
    negated = StudyKey("wrong_sign", "names", [], "encoders with the wrong sign", choices=encoders)
    zero = "zero of encoders of {} wrong by this, either way"
    angle = sized("encoder_offset_deg", zero.format("angles"), names.angles, -np.inf)
    length = sized("encoder_offset_m", zero.format("lengths"), names.lengths, -np.inf)
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
    streams = [replace(stream, name=other.get(stream.name, stream.name)) for stream in recording.streams]
    places = {name: place for place, name in enumerate(recording.names)}
    streams.sort(key=lambda stream: places.get(stream.name, len(places)))
    return Recording(streams, recording.meta)


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
