"""`ExportPiece`: the strokes of another device as a piece without a track, for the front of its page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.alongside.counted import counted_strokes
from oarlock.rowing.analysis.stroke_means import feature_means
from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.report.averages import Average, averages
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.epoch import moment_text


@dataclass(frozen=True)
class ExportPiece:
    """A table of strokes of another device."""

    table: StrokeTable

    @property
    def name(self) -> str:
        """The file."""
        return self.table.source.partition(": ")[0]

    @property
    def date(self) -> str:
        """The day on which it begins; "" if unknown."""
        return moment_text(self.table.epoch)[:10]

    @property
    def device(self) -> str:
        """The device, such as "NK SpeedCoach"."""
        return device_of(self.table.source)

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """Which strokes count in averages, (N,)."""
        return counted_strokes(self.table)

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Averages over the counted strokes. Their uncertainty is the scatter: a device's errors are not known."""
        known = {name: np.zeros(len(self.table)) for name in self.table.columns}
        return averages(self.table, feature_means(replace(self.table, stds=known), self.counted))

    def rowed(self) -> Rowed:
        """For findings. Which boat it was is known of ergometers only, which measure the handle and no oar."""
        on_ergometer = "handle_travel_m" in self.table and "arc_rad" not in self.table
        return Rowed.of_table(self.table, self.counted, "ergometer" if on_ergometer else "", self.device)


def device_of(source: str) -> str:
    """The device of an export's source, "FILE: DEVICE, what"."""
    return (source.partition(": ")[2] or source).partition(",")[0]
