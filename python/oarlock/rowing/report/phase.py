"""Strokes resampled at equal shares of their time, from catch to catch, for the report's mean curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.strokes.table import Floats, StrokeTable

if TYPE_CHECKING:
    from oarlock import Track

POINTS = 101
"""Shares of a stroke at which curves are compared: whole percents (RtcNoord takes 100)."""
HULL = "hull"
"""The frame of a boat whose rotation is in the model."""


@dataclass(frozen=True)
class Stack:
    """The strokes of a piece at equal shares of their time.

    Attributes:
        time_s: (N, POINTS) when each stroke was there, s.
        q: (N, POINTS, n_coordinates) posture then.
    """

    time_s: Floats
    q: Floats

    def __len__(self) -> int:
        return len(self.time_s)


def stack(track: Track, table: StrokeTable, counted: NDArray[np.bool_]) -> Stack:
    """The counted strokes inside the track."""
    start, end = table["catch_time_s"], table["end_time_s"]
    inside = counted & (start >= track.time_s[0]) & (end <= track.time_s[-1])
    start, end = start[inside], end[inside]
    time_s = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, POINTS)
    flat = [np.interp(time_s.ravel(), track.time_s, column) for column in track.q.T]
    return Stack(time_s, np.stack(flat, axis=-1).reshape(*time_s.shape, len(flat)))


def frame_courses(track: Track, strokes: Stack, frames: Sequence[str]) -> dict[str, Floats]:
    """Origins of frames in axes of the hull, or of the root without a hull; (N, POINTS, 3) m by name.

    Computed stroke by stroke to limit memory.
    """
    model = track.model
    if model is None:
        return {}
    places = {name: model.frame_names.index(name) for name in frames if name in model.frame_names}
    hull = model.frame_names.index(HULL) if HULL in model.frame_names else 0
    known = np.where(np.isnan(track.q).all(axis=0), 0.0, strokes.q)
    found: dict[str, list[Floats]] = {name: [] for name in places}
    for posture in known:
        poses = model.forward_kinematics(posture)
        turned, origin = poses[:, hull, :3, :3], poses[:, hull, :3, 3]
        for name, place in places.items():
            found[name].append(np.einsum("tji,tj->ti", turned, poses[:, place, :3, 3] - origin))
    return {name: np.stack(rows) if rows else np.empty((0, POINTS, 3)) for name, rows in found.items()}


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Over strokes (first axis); the SD of a single stroke is NaN."""
    mean = values.mean(axis=0)
    sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.full_like(mean, np.nan)
    return mean, sd
