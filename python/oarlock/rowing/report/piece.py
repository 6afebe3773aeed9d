"""One piece of rowing for the report: a track, its technique, and the resampled postures of its strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from oarlock import Track
from oarlock.report import date_of
from oarlock.rowing.analysis.observed_posture import observed_q
from oarlock.rowing.analysis.rower_places import RowerFrames
from oarlock.rowing.analysis.technique import Technique
from oarlock.rowing.report.averages import Average, averages, feature_of
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats

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


def stack(track: Track, table: StrokeTable, counted: Bools) -> Stack:
    """The counted strokes inside the track; NaN where a posture was not observed."""
    start, end = table["catch_time_s"], table["end_time_s"]
    inside = counted & (start >= track.time_s[0]) & (end <= track.time_s[-1])
    start, end = start[inside], end[inside]
    q = track.q if track.model is None else observed_q(track, RowerFrames(track.model))
    time_s = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, POINTS)
    flat = [np.interp(time_s.ravel(), track.time_s, column) for column in q.T]
    return Stack(time_s, np.stack(flat, axis=-1).reshape(*time_s.shape, len(flat)))


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Over strokes (first axis); the SD of a single stroke is NaN."""
    mean = values.mean(axis=0)
    sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.full_like(mean, np.nan)
    return mean, sd


class Counted(Protocol):
    """A piece or an export: strokes, which of them count, and averages of those."""

    @property
    def name(self) -> str:
        """For people."""

    @property
    def date(self) -> str:
        """The day, such as 2026-05-01; "" if unknown."""

    @property
    def table(self) -> StrokeTable:
        """The strokes."""

    @property
    def counted(self) -> Bools:
        """Which strokes count in averages, (N,)."""

    @property
    def averages(self) -> dict[str, Average]:
        """Averages of every number over the counted strokes."""


@dataclass(frozen=True)
class ReportPiece:
    """A track with its technique.

    Attributes:
        name: name of the piece for people; "" for a single piece.
        track: what was tracked.
        technique: its strokes with their numbers and curves.
        folder: name of the track's folder; "" if it is not known.
    """

    name: str
    track: Track
    technique: Technique
    folder: str = ""

    @property
    def date(self) -> str:
        """The day, such as 2026-05-01; "" if unknown."""
        return date_of(self.track.provenance)

    @property
    def table(self) -> StrokeTable:
        """The strokes."""
        return self.technique.strokes

    @property
    def counted(self) -> Bools:
        """Which strokes count in averages, (N,)."""
        return self.technique.found.in_averages

    @property
    def finish_percent(self) -> float:
        """Mean share of the stroke at which the drive ends; NaN without counted strokes."""
        return next((curve.finish_percent for curve in self.technique.curves.values()), float("nan"))

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Averages of every number over the counted strokes."""
        return averages(self.table, self.technique.summary)

    @cached_property
    def sides(self) -> dict[str, Average]:
        """Right minus left of every number that both sides have, by its name without the side."""
        found = self.technique.symmetry.items()
        return {name: Average(feature_of(f"r_{name}"), mean) for name, mean in found if mean.count}

    @cached_property
    def strokes(self) -> Stack:
        """Postures of the counted strokes, at equal shares of each."""
        return stack(self.track, self.table, self.counted)

    def frames(self, names: Sequence[str]) -> dict[str, Floats]:
        """Courses (N, POINTS, 3), m, of those frames that the model has, in the hull's axes; none without strokes.

        Computed stroke by stroke to limit memory.
        """
        model = self.track.model
        if model is None or not len(self.strokes):
            return {}
        places = [RowerFrames(model).places(posture) for posture in self.strokes.q]
        known = [name for name in names if name in model.frame_names]
        return {name: np.array([one[name] for one in places]).reshape(-1, POINTS, 3) for name in known}
