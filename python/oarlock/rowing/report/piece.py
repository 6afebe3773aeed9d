"""One piece of rowing as the report sees it: a track, its strokes, their averages, and the strokes laid together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from oarlock.rowing.report.averages import Average, averages
from oarlock.rowing.report.phase import Stack, frame_courses, mean_and_sd, stack
from oarlock.rowing.stroke_table import Floats, StrokeTable

if TYPE_CHECKING:
    from oarlock import Track


@dataclass(frozen=True)
class MeanCourse:
    """Mean and SD over the strokes at shares of a stroke, (POINTS,) each."""

    percent: Floats
    mean: Floats
    sd: Floats


@dataclass(frozen=True)
class Piece:
    """A track with its strokes.

    Attributes:
        name: of the piece, for people; "" where it is the only one.
        track: what was tracked.
        table: its strokes with all that is known of them.
        notes: what the search for strokes has to say.
    """

    name: str
    track: Track
    table: StrokeTable
    notes: Sequence[str] = ()

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Of every number, over the strokes that count."""
        return averages(self.table)

    @cached_property
    def strokes(self) -> Stack:
        """The strokes at the same shares."""
        return stack(self.track, self.table)

    def joint(self, name: str) -> MeanCourse | None:
        """Mean course of a coordinate; None where the model has no such joint, or nothing is known of it."""
        if name not in self.track.coordinate_names or not len(self.strokes):
            return None
        values = self.strokes.q[..., self.track.coordinate_names.index(name)]
        if not np.isfinite(values).all(axis=1).any():
            return None
        return MeanCourse(self.strokes.percent, *mean_and_sd(values[np.isfinite(values).all(axis=1)]))

    def frames(self, names: Sequence[str]) -> dict[str, Floats]:
        """Courses (N, POINTS, 3), m, of those frames that the model has, in the hull's axes; none without strokes."""
        return frame_courses(self.track, self.strokes, names) if len(self.strokes) else {}
