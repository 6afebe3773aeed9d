"""Which streams of a recording belong to sensors of a model; `track` leaves the others out."""

import difflib
from collections.abc import Mapping

import numpy as np

from oarlock._core import Model
from oarlock.model.description import ImuDescription
from oarlock.recording.inertial_units import at_nearest
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

NEAR = 0.75
"""Similarity (0 to 1, `difflib`) from which an unknown name counts as a misspelt one."""


def known_streams(model: Model, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """The streams of a recording that belong to the model, and a note that names the others.

    Rows of an inertial unit that hold only what the model does not measure, such as those of a magnetometer between
    those of the gyroscope, are left out, because they would become samples without a reading. Such readings stand at
    the nearest row instead, so that notes and counts know of them.

    Raises:
        DataError: no stream belongs to the model, or a name is so similar to that of a sensor without a stream that it
            is probably misspelt.
    """
    described = model.describe()
    known = [*model.sensor_names, *(joint.name for joint in described.joints if joint.input)]
    kept = [name for name in recording.names if name in known]
    others = [name for name in recording.names if name not in known]
    units = {unit.name: unit for unit in described.inertial_units}
    if not others:
        return _measured(recording, units), ()
    if not kept:
        raise DataError(
            f'stream "{others[0]}": model "{model.name}" has no sensor or input of that name. '
            f"{did_you_mean(others[0], known)} No stream of the recording ({', '.join(recording.names)}) belongs to "
            f"this model: rename the streams, or import them with `oarlock import PATH --model {model.name}`"
        )
    free = {name.casefold(): name for name in known if name not in kept}
    for name in others:
        if near := difflib.get_close_matches(name.casefold(), free, n=1, cutoff=NEAR):
            raise DataError(
                f'stream "{name}": model "{model.name}" has no sensor or input of that name. '
                f'Did you mean "{free[near[0]]}"? Rename the stream, or leave it out: recording.without("{name}"), '
                f"or --without {name}"
            )
    return _measured(recording.only(kept), units), (left_out(others),)


def left_out(names: list[str]) -> str:
    """The note on streams that the model has no sensor for."""
    count = "1 stream" if len(names) == 1 else f"{len(names)} streams"
    return f"{count} without a sensor in this model: {', '.join(names)}; not used"


def not_measured(unit: ImuDescription) -> set[str]:
    """Fields of a stream that the model's unit does not measure."""
    stds = {"gyro_rad_s": unit.gyro_std_rad_s, "accel_m_s2": unit.accel_std_m_s2, "mag_ut": unit.mag_std_ut}
    return {name for name, std in stds.items() if std is None}


def _measured(recording: Recording, units: Mapping[str, ImuDescription]) -> Recording:
    """The recording itself, or without rows of units that hold no reading of what the model measures."""
    streams = [_with_readings(stream, units) for stream in recording.streams]
    if all(new is old for new, old in zip(streams, recording.streams, strict=True)):
        return recording
    return Recording(streams, recording.meta)


def _with_readings(stream: Stream, units: Mapping[str, ImuDescription]) -> Stream:
    if not isinstance(stream, ImuStream) or stream.name not in units:
        return stream
    ignored = not_measured(units[stream.name])
    unused = [values for name, values in stream.values.items() if name in ignored]
    used = {name: values for name, values in stream.values.items() if name not in ignored}
    if not unused or not used:
        return stream
    empty = np.all([np.isnan(values).all(axis=1) for values in used.values()], axis=0)
    idle = empty & np.any([np.isfinite(values).any(axis=1) for values in unused], axis=0)
    if not idle.any():
        return stream
    kept = np.flatnonzero(~idle)
    values = {
        name: v[kept] if name in used else at_nearest(stream.time_s, v, kept)
        for name, v in stream.values.items()
    }
    return ImuStream(stream.name, stream.time_s[kept], **values)
