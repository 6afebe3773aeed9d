"""A recording without the vibration of skin and clothes: `Recording.low_passed`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from oarlock.recording.butterworth import passed_twice
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_SAMPLES_A_PERIOD = 4.0
"""Samples that stay for each period of the cut-off."""
_GAP = 1.5
"""A step of so many usual ones is a gap; each side is filtered by itself."""


def low_passed(streams: Iterable[Stream], cutoff_hz: float) -> list[Stream]:
    """See `Recording.low_passed`."""
    if not (np.isfinite(cutoff_hz) and cutoff_hz > 0.0):
        raise DataError(
            f"low_passed: cutoff_hz = {cutoff_hz}; expected a positive number of Hz, for example 6"
        )
    return [_filtered(s, cutoff_hz) if isinstance(s, ImuStream) else s for s in streams]


def _filtered(stream: ImuStream, cutoff_hz: float) -> Stream:
    """Each quantity at its own rows: a magnetometer with a rate of its own does not interrupt the gyroscope."""
    moving = [name for name in stream.values if name != "mag_ut"] or list(stream.values)
    parts = [moving, [name for name in stream.values if name not in moving]]
    kept = np.zeros(len(stream), dtype=bool)
    silent = np.isnan(np.hstack([v.reshape(len(v), -1) for v in stream.values.values()])).all(axis=1)
    values = {name: np.full(v.shape, np.nan) for name, v in stream.values.items()}
    for names in filter(None, parts):
        columns = np.hstack([stream.values[name] for name in names])
        rows = np.flatnonzero(np.isfinite(columns).any(axis=1) | silent)
        if len(rows) < 2:
            return stream
        own = stream.time_s[rows]
        step_s = float(np.median(np.diff(own)))
        every = int(1.0 / (step_s * _SAMPLES_A_PERIOD * cutoff_hz))
        if every < 1 and names is moving:
            raise DataError(
                f'low_passed: "{stream.name}" has {1.0 / step_s:.4g} samples/s; a cut-off of {cutoff_hz:g} Hz needs '
                f"{_SAMPLES_A_PERIOD * cutoff_hz:g}. Choose {1.0 / (step_s * _SAMPLES_A_PERIOD):.3g} Hz or less"
            )
        for name in names:
            array = stream.values[name][rows]
            passed = _in_stretches(own, array, step_s, cutoff_hz) if every >= 1 else array
            values[name][rows[:: max(every, 1)]] = passed[:: max(every, 1)]
        kept[rows[:: max(every, 1)]] = True
    return ImuStream(stream.name, stream.time_s[kept], **{name: v[kept] for name, v in values.items()})


def _in_stretches(time_s: Floats, values: Floats, step_s: float, cutoff_hz: float) -> Floats:
    filtered = np.array(values)
    there = np.asarray(np.isfinite(values).all(axis=1))
    broken = np.diff(time_s) > _GAP * step_s
    edges = np.flatnonzero(broken | (there[1:] != there[:-1])) + 1
    for rows in np.split(np.arange(len(time_s)), edges):
        if there[rows[0]] and len(rows) > 2:
            filtered[rows] = passed_twice(values[rows], 1.0 / step_s, cutoff_hz)
    return filtered
