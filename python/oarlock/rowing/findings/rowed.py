"""`Rowed`: the counted strokes of a piece with their deviations, as findings compare them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from oarlock.rowing.analysis.targets import Target
from oarlock.rowing.findings.watched import Watched
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats

RATES_APART = 6.0
"""Pieces whose usual rates differ by more strokes a minute are not compared."""
FEWEST_STROKES = 6
"""Smallest number of strokes of one number for anything but a difference of sides."""


class StoredStrokes(Counted, Protocol):
    """Strokes without their track, which say themselves what they are: a `StoredPiece`."""

    def rowed(self) -> Rowed:
        """For findings."""


@dataclass(frozen=True, eq=False)
class Rowed:
    """Counted strokes of one piece, (N,) each, SI and radians.

    Attributes:
        kind: "sculling", "sweep" or "ergometer"; "" if it is not known.
        columns: numbers by name; NaN where unknown.
        stds: standard deviations of single strokes by the same names; errors of mounts and lengths are the same in all.
        numbers: of the strokes in the piece, the first is 1.
        targets: by column; empty if none were chosen.
        source: signal from which the strokes were found, or the device that counted them.
        least: smallest sizes that matter, in shown units, where this rower's own differ from the general ones.
    """

    kind: str
    columns: Mapping[str, Floats]
    stds: Mapping[str, Floats]
    numbers: Floats
    targets: Mapping[str, Target]
    source: str
    least: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, piece: ReportPiece | StoredStrokes) -> Rowed:
        """Of a piece."""
        if not isinstance(piece, ReportPiece):
            return piece.rowed()
        technique = piece.technique
        rowed = cls.of_table(piece.table, piece.counted, rowing_kind(piece), technique.found.source)
        return replace(rowed, targets=technique.targets)

    @classmethod
    def of_table(cls, table: StrokeTable, counted: Bools, kind: str, source: str) -> Rowed:
        """Of the counted strokes (N,) of a table; without rates there is nothing of the rate to remove."""
        columns = {name: table[name][counted] for name in table.columns}
        columns.setdefault("rate_per_min", np.zeros(int(counted.sum())))
        stds = {name: table.std(name)[counted] for name in table.columns}
        numbers = np.asarray(np.flatnonzero(counted) + 1, dtype=np.float64)
        return cls(kind, columns, stds, numbers, {}, source)

    def good(self, name: str) -> Bools:
        """Strokes that have this number and a rate, (N,)."""
        known = np.isfinite(self.columns["rate_per_min"])
        return known & np.isfinite(self.columns[name]) if name in self.columns else np.zeros_like(known)

    @property
    def rate_per_min(self) -> float:
        """Usual stroke rate; NaN if unknown."""
        rates = self.columns["rate_per_min"][self.good("rate_per_min")]
        return float(np.median(rates)) if len(rates) else float("nan")

    def shared_std(self, name: str) -> float:
        """Uncertainty that all strokes share, which averaging does not reduce; 0 if unknown."""
        stds = self.stds[name][self.good(name)]
        stds = stds[np.isfinite(stds)]
        return float(np.sqrt(np.mean(stds**2))) if len(stds) else 0.0

    def own(self, watched: Watched) -> Watched:
        """The number with the smallest size that matters in this piece."""
        return replace(watched, own_least=self.least.get(watched.name, watched.own_least))

    def comparable(self, other: Rowed) -> bool:
        """Whether numbers of both mean the same: boat kind, signal of the strokes, and about the stroke rate."""
        apart = abs(self.rate_per_min - other.rate_per_min)
        return self.kind == other.kind and self.source == other.source and apart <= RATES_APART


def rowing_kind(piece: ReportPiece) -> str:
    """Sculling, sweep or ergometer, from the joints of the model."""
    return kind_of(piece.track.joint_names)


def kind_of(joints: Collection[str]) -> str:
    """As `rowing_kind`, from the names of the joints."""
    if "handle" in joints:
        return "ergometer"
    return "sweep" if "oar_phi" in joints else "sculling"
