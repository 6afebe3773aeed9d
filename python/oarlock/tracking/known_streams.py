"""Which streams of a recording belong to sensors of a model; `track` leaves the others out."""

import difflib

from oarlock._core import Model
from oarlock.model.description import ImuDescription
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

NEAR = 0.75
"""Similarity (0 to 1, `difflib`) from which an unknown name counts as a misspelt one."""


def known_streams(model: Model, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """The streams of a recording that belong to the model, and a note that names the others.

    Raises:
        DataError: no stream belongs to the model, or a name is so similar to that of a sensor without a stream that it
            is probably misspelt.
    """
    described = model.describe()
    known = [*model.sensor_names, *(joint.name for joint in described.joints if joint.input)]
    kept = [name for name in recording.names if name in known]
    others = [name for name in recording.names if name not in known]
    if not others:
        return recording, ()
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
    return recording.only(kept), (left_out(others),)


def left_out(names: list[str]) -> str:
    """The note on streams that the model has no sensor for."""
    count = "1 stream" if len(names) == 1 else f"{len(names)} streams"
    return f"{count} without a sensor in this model: {', '.join(names)}; not used"


def not_measured(unit: ImuDescription) -> set[str]:
    """Fields of a stream that the model's unit does not measure."""
    stds = {"gyro_rad_s": unit.gyro_std_rad_s, "accel_m_s2": unit.accel_std_m_s2, "mag_ut": unit.mag_std_ut}
    return {name for name, std in stds.items() if std is None}
