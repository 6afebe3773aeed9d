"""One piece of rowing for the report: a track, its technique, and the resampled postures of its strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from oarlock import Track
from oarlock.report import date_of
from oarlock.rowing.analysis.technique import Technique
from oarlock.rowing.report.averages import Average, averages, feature_of
from oarlock.rowing.report.phase import Stack, frame_courses, stack
from oarlock.rowing.strokes.table import Floats, StrokeTable


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
    def counted(self) -> NDArray[np.bool_]:
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
    def counted(self) -> NDArray[np.bool_]:
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
        """Courses (N, POINTS, 3), m, of those frames that the model has, in the hull's axes; none without strokes."""
        return frame_courses(self.track, self.strokes, names) if len(self.strokes) else {}
