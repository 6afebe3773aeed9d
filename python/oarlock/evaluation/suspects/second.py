"""Selects the most informative second of a recording and resamples it to one time grid, for `suspects`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.array_gate import FloatArray

STEP_S = 0.25
"""Seconds that are looked at begin this far apart."""
SEARCHED_S = 300.0
"""No further into a recording than this."""
LIVELY_RAD_S = 1.0
"""A unit that turns so fast (root mean square) is as lively as one that turns faster."""
LIVELY_CHANGE = 0.1
"""The same of an encoder's or a position's deviation, rad or m."""
LEAST_ROWS = 12
"""Samples of at least one stream, below which a second tells nothing."""


def liveliest(recording: Recording, seconds: float) -> tuple[float, float]:
    """Where the second begins in which most sensors move most, s, and how lively it is, 0 to 1."""
    begin, end = recording.start_s, min(recording.end_s, recording.start_s + SEARCHED_S)
    steps = np.arange(max(1, int((end - begin - seconds) / STEP_S + 1e-6) + 1))
    starts: FloatArray = np.asarray(begin + STEP_S * steps, dtype=np.float64)
    lively = np.mean([_liveliness(stream, starts, seconds) for stream in recording.streams], axis=0)
    best = int(np.argmax(lively))
    return float(starts[best]), float(lively[best])


def on_grid(recording: Recording, start_s: float, seconds: float, rate_hz: float) -> Recording | None:
    """Each stream's readings that are nearest to the stamps of a common grid, moved to these stamps.

    Units on clocks of their own then make samples together, so that every reading is held against all others. A
    stream slower than the grid keeps its own pace. None if no stream has enough.
    """
    step = 1.0 / rate_hz
    rows = np.arange(max(1, round(seconds * rate_hz)))
    grid: FloatArray = np.asarray(start_s + step * (0.5 + rows), dtype=np.float64)
    parts = [part for stream in recording.streams if (part := _nearest(stream, grid, step)) is not None]
    if not parts or max(len(part) for part in parts) < LEAST_ROWS:
        return None
    return Recording(parts)


def _liveliness(stream: Stream, starts: FloatArray, seconds: float) -> FloatArray:
    """Of each second, 0 to 1: root mean square of the gyro, or deviation of a value, times the share of rows there."""
    if isinstance(stream, ImuStream):
        if stream.gyro_rad_s is None:
            return np.zeros(len(starts))
        rows, lively = stream.gyro_rad_s, LIVELY_RAD_S
    else:
        rows, lively = np.column_stack(list(stream.values.values())), LIVELY_CHANGE
    whole: NDArray[np.bool_] = np.asarray(np.isfinite(rows).all(axis=1))
    rows = np.where(whole[:, None], rows, 0.0)
    edges: NDArray[np.intp] = np.asarray(np.searchsorted(stream.time_s, np.stack([starts, starts + seconds])))
    count = _between(whole.astype(float), edges)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = _between((rows**2).sum(axis=1), edges) / count
        if not isinstance(stream, ImuStream):
            square -= np.sum([(_between(column, edges) / count) ** 2 for column in rows.T], axis=0)
    spread = np.sqrt(np.nan_to_num(square).clip(min=0.0))
    there = np.minimum(1.0, count / max(1.0, float(count.max())))
    return np.asarray(np.minimum(1.0, spread / lively) * there)


def _between(values: FloatArray, edges: NDArray[np.intp]) -> FloatArray:
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(sums[edges[1]] - sums[edges[0]])


def _nearest(stream: Stream, grid: FloatArray, step: float) -> Stream | None:
    if len(stream) == 1:
        rows = np.zeros(len(grid), dtype=int)
    else:
        rows = np.clip(np.searchsorted(stream.time_s, grid), 1, len(stream) - 1)
        rows = rows - (grid - stream.time_s[rows - 1] < stream.time_s[rows] - grid)
    near = np.abs(stream.time_s[rows] - grid) <= 0.5 * step
    if not near.any():
        return None
    values = {name: array[rows[near]] for name, array in stream.values.items()}
    return type(stream)(stream.name, grid[near], **values)  # type: ignore[arg-type]
