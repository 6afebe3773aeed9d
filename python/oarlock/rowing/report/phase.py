"""Strokes resampled at equal shares of their time, from catch to catch, for the report's mean curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.analysis.observed_posture import observed_q
from oarlock.rowing.analysis.rower_places import RowerFrames
from oarlock.rowing.strokes.table import Floats, StrokeTable

if TYPE_CHECKING:
    from oarlock import Track

POINTS = 101
"""Shares of a stroke at which curves are compared: whole percents (RtcNoord takes 100)."""


@dataclass(frozen=True)
class Stack:
    """The strokes of a piece at equal shares of their time.

    Attributes:
        time_s: (N, POINTS) when each stroke was there, s.
        q: (N, POINTS, n_coordinates) posture then; NaN where it was not observed.
    """

    time_s: Floats
    q: Floats

    def __len__(self) -> int:
        return len(self.time_s)


def stack(track: Track, table: StrokeTable, counted: NDArray[np.bool_]) -> Stack:
    """The counted strokes inside the track; NaN where a posture was not observed."""
    start, end = table["catch_time_s"], table["end_time_s"]
    inside = counted & (start >= track.time_s[0]) & (end <= track.time_s[-1])
    start, end = start[inside], end[inside]
    q = track.q if track.model is None else observed_q(track, RowerFrames(track.model))
    time_s = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, POINTS)
    flat = [np.interp(time_s.ravel(), track.time_s, column) for column in q.T]
    return Stack(time_s, np.stack(flat, axis=-1).reshape(*time_s.shape, len(flat)))


def frame_courses(track: Track, strokes: Stack, frames: Sequence[str]) -> dict[str, Floats]:
    """Places of the rower's frames as in `RowerFrames.places`; (N, POINTS, 3) m by name, NaN where they are not known.

    Computed stroke by stroke to limit memory.
    """
    if track.model is None:
        return {}
    rower, names = RowerFrames(track.model), [name for name in frames if name in track.model.frame_names]
    found = [rower.places(posture) for posture in strokes.q]
    return {name: np.array([one[name] for one in found]).reshape(-1, POINTS, 3) for name in names}


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Over strokes (first axis); the SD of a single stroke is NaN."""
    mean = values.mean(axis=0)
    sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.full_like(mean, np.nan)
    return mean, sd
