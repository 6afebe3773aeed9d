"""Selects the most informative second of a recording and resamples it to one time grid, for `suspects`."""

from __future__ import annotations

import numpy as np

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.arrays import Bools, Floats, Indices

STEP_S = 0.25
"""Interval between the starts of the examined seconds, s."""
SEARCHED_S = 300.0
"""Only this first part of a recording is searched, s."""
FULL_MOTION_RAD_S = 1.0
"""Angular rate (root mean square) at which the motion score of a unit reaches 1."""
FULL_MOTION_CHANGE = 0.1
"""The same for the deviation of an encoder or position, rad or m."""
LEAST_ROWS = 12
"""Smallest number of samples of at least one stream for a usable second."""


def most_motion(recording: Recording, seconds: float) -> tuple[float, float]:
    """Start of the second with the most motion, s, and its motion score, 0 to 1."""
    begin, end = recording.start_s, min(recording.end_s, recording.start_s + SEARCHED_S)
    steps = np.arange(max(1, int((end - begin - seconds) / STEP_S + 1e-6) + 1))
    starts: Floats = np.asarray(begin + STEP_S * steps, dtype=np.float64)
    scores = np.mean([_motion_score(stream, starts, seconds) for stream in recording.streams], axis=0)
    best = int(np.argmax(scores))
    return float(starts[best]), float(scores[best])


def on_grid(recording: Recording, start_s: float, seconds: float, rate_hz: float) -> Recording | None:
    """The readings of each stream that are nearest to the time stamps of a common grid, assigned to these time stamps.

    Units with their own clocks then form common samples, so that all readings are compared. A stream that is slower
    than the grid keeps its rate. None if no stream has enough readings.
    """
    step = 1.0 / rate_hz
    rows = np.arange(max(1, round(seconds * rate_hz)))
    grid: Floats = np.asarray(start_s + step * (0.5 + rows), dtype=np.float64)
    parts = [part for stream in recording.streams if (part := _nearest(stream, grid, step)) is not None]
    if not parts or max(len(part) for part in parts) < LEAST_ROWS:
        return None
    return Recording(parts)


def _motion_score(stream: Stream, starts: Floats, seconds: float) -> Floats:
    """Motion score, 0 to 1: root mean square of the gyroscope, or deviation of a value, times the share of rows."""
    if isinstance(stream, ImuStream):
        if stream.gyro_rad_s is None:
            return np.zeros(len(starts))
        rows, full_motion = stream.gyro_rad_s, FULL_MOTION_RAD_S
    else:
        rows, full_motion = np.column_stack(list(stream.values.values())), FULL_MOTION_CHANGE
    whole: Bools = np.asarray(np.isfinite(rows).all(axis=1))
    rows = np.where(whole[:, None], rows, 0.0)
    edges: Indices = np.asarray(np.searchsorted(stream.time_s, np.stack([starts, starts + seconds])))
    count = _between(whole.astype(float), edges)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = _between((rows**2).sum(axis=1), edges) / count
        if not isinstance(stream, ImuStream):
            square -= np.sum([(_between(column, edges) / count) ** 2 for column in rows.T], axis=0)
    spread = np.sqrt(np.nan_to_num(square).clip(min=0.0))
    there = np.minimum(1.0, count / max(1.0, float(count.max())))
    return np.asarray(np.minimum(1.0, spread / full_motion) * there)


def _between(values: Floats, edges: Indices) -> Floats:
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(sums[edges[1]] - sums[edges[0]])


def _nearest(stream: Stream, grid: Floats, step: float) -> Stream | None:
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
