"""`StoredPiece`: strokes without their track, such as a season keeps them, to compare a report's piece with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oarlock.rowing.analysis.stroke_means import feature_means
from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.report.averages import Average, averages
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools

_SOURCE = "strokes from "
"""`Strokes.table` writes the signal after this."""


@dataclass(frozen=True)
class StoredPiece:
    """The strokes of a piece, as `technique` made them and `save_strokes` kept them.

    Attributes:
        name: for people.
        table: the strokes with their standard deviations.
        kind: "sculling", "sweep" or "ergometer"; "" if it is not known.
        date: the day, such as 2026-05-01; "" if it is not known.
    """

    name: str
    table: StrokeTable
    kind: str
    date: str = ""

    @property
    def counted(self) -> Bools:
        """Which strokes count in averages, (N,)."""
        return (
            self.table["in_averages"] > 0.0 if "in_averages" in self.table else np.ones(len(self.table), bool)
        )

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Averages of every number over the counted strokes."""
        return averages(self.table, feature_means(self.table, self.counted))

    def rowed(self) -> Rowed:
        """For findings."""
        source = self.table.source.removeprefix(_SOURCE)
        return Rowed.of_table(self.table, self.counted, self.kind, source)
