"""How late one stream's readings are against what a track says they should have been, in windows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from oarlock._core import Model
from oarlock.models import Base
from oarlock.recording import ImuStream, Stream, VectorStream
from oarlock.track import Track

Floats = NDArray[np.float64]

WINDOW_S = 5.0
"""A few strides: long enough for twelve numbers of a mount, short enough for many windows."""
_STEP_S = 0.008
"""Half the span over which a predicted reading's slope is taken; limbs hardly turn faster than 10 Hz."""
_BLOCK_S = 0.5
"""Errors of a track last for tenths of a second: sums over this long are taken as independent."""
_LEAST_SAMPLES = 40


@dataclass(frozen=True)
class Delay:
    """Of one stream in one window.

    Args:
        time_s: middle of the window.
        delay_s: by how much its stamps are late: reading(stamp) = what was true at stamp - delay.
        std_s: standard deviation of it, of errors that last for tenths of a second.
    """

    time_s: float
    delay_s: float
    std_s: float


Row = tuple[str, str]
"""A stream and the quantity of it that is held against a track: `gyro_rad_s`, `accel_m_s2` or `value`."""


def rows_of(model: Model, stream: Stream) -> dict[Row, list[int]]:
    """Columns of `Model.predict_measurements` for each quantity of a stream; none for an input joint's stream."""
    if isinstance(stream, ImuStream):
        parts = {
            f: [f"{stream.name}.{part}_{axis}" for axis in "xyz"] for f, part in _FELT if f in stream.values
        }
    elif isinstance(stream, VectorStream):
        parts = {"value": [f"{stream.name}.{axis}" for axis in "xyz"]}
    else:
        parts = {"value": [stream.name]}
    names = model.measurement_names
    return {
        (stream.name, field): [names.index(n) for n in wanted if n in names]
        for field, wanted in parts.items()
        if any(n in names for n in wanted)
    }


_FELT = (("gyro_rad_s", "gyro"), ("accel_m_s2", "accel"))


def predicted(model: Model, track: Track) -> Floats:
    """(T, n_measurements) readings that a smoothed track predicts, by the model's nominal mounts."""
    q, qd, qdd = (np.nan_to_num(rows, nan=0.0) for rows in (track.q, track.qd, track.qdd))
    pushed = np.zeros((len(q), 3))
    for base in model.describe()["base_acceleration"]:
        if base["name"] in track.slow:
            pushed += track.slow[base["name"]].value[:, None] * np.array(base["axis"])
    level = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    return model.predict_measurements(q, qd, qdd, Base(level, acceleration_m_s2=pushed))


def delays(
    model: Model, track: Track, streams: Iterable[Stream], start_s: float, end_s: float
) -> dict[Row, list[Delay]]:
    """The delay of each quantity in each window between start and end, where it can be told at all."""
    readings, found = predicted(model, track), {}
    for stream in streams:
        for row, columns in rows_of(model, stream).items():
            read = stream.values[row[1]].reshape(len(stream), -1)
            found[row] = list(
                _windows(track.time_s, readings[:, columns], stream.time_s, read, start_s, end_s)
            )
    return found


def _windows(
    track_s: Floats, expected: Floats, stamps_s: Floats, read: Floats, start_s: float, end_s: float
) -> Iterator[Delay]:
    count = max(1, int((end_s - start_s) / WINDOW_S))
    edges = np.linspace(start_s, end_s, count + 1)
    for first, last in pairwise(edges):
        inside = (stamps_s >= first) & (stamps_s < last) & np.isfinite(read).all(axis=1)
        if np.count_nonzero(inside) < _LEAST_SAMPLES:
            continue
        stamps = stamps_s[inside]
        now, before, after = (_at(track_s, expected, stamps + way) for way in (0.0, -_STEP_S, _STEP_S))
        delay = _window(stamps, read[inside], now, (after - before) / (2.0 * _STEP_S))
        if delay is not None:
            yield Delay(float(0.5 * (first + last)), *delay)


def _at(track_s: Floats, rows: Floats, time_s: Floats) -> Floats:
    return np.stack([np.interp(time_s, track_s, column) for column in rows.T], axis=1)


def _window(stamps_s: Floats, read: Floats, expected: Floats, slope: Floats) -> tuple[float, float] | None:
    """Least squares of read = B expected + b - delay B slope: B is whatever a mount or a strap does to it."""
    design = np.column_stack([np.ones(len(expected)), expected])
    basis, _ = np.linalg.qr(design)
    shape = np.linalg.lstsq(design, read, rcond=None)[0][1:]
    turned = slope @ shape
    left, felt = (rows - basis @ (basis.T @ rows) for rows in (read, turned))
    power = np.sum(felt**2, axis=0)
    if not power.max(initial=0.0) > 0.0:
        return None
    delay = 0.0
    weight = np.ones(read.shape[1])
    for _ in range(3):
        delay = -float(np.sum(weight * left * felt) / np.sum(weight * power))
        spread = np.mean((left + delay * felt) ** 2, axis=0)
        weight = 1.0 / np.maximum(spread, 1e-3 * spread.max(initial=1e-30) + 1e-30)
    score = np.sum(weight * (left + delay * felt) * felt, axis=1)
    blocks = np.add.reduceat(score, _block_starts(stamps_s))
    return delay, float(np.sqrt(np.sum(blocks**2)) / np.sum(weight * power))


def _block_starts(stamps_s: Floats) -> NDArray[np.int64]:
    number = np.floor((stamps_s - stamps_s[0]) / _BLOCK_S).astype(np.int64)
    return np.flatnonzero(np.diff(number, prepend=-1))
