"""`ExportPiece`: the strokes of another device as a piece without a track, for the front of its page."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from oarlock.rowing.alongside.course import SpeedProfile, course_of
from oarlock.rowing.analysis.stroke_means import feature_means
from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, averages
from oarlock.rowing.report.export_fade import Faded, faded_of
from oarlock.rowing.strokes.table import Floats, StrokeTable
from oarlock.storage.epoch import moment_text

_MATTERS = 0.05
"""Share of a rower's own force, work or power from which a change matters; makers and references differ by more."""
_OF_FORCE = ("N", "J", "W")
_SCULLS = re.compile(r"\b[1248]x|scull|double|quad", re.IGNORECASE)
_SWEEPS = re.compile(r"\b[248][+-]|sweep|pair|eight", re.IGNORECASE)
_OAR = re.compile(r"\boar (\d+(?:\.\d+)?) cm")
_LONGEST_SCULL_CM = 330.0
"""Sculls are 2.8 to 2.95 m long, sweep oars 3.6 to 3.85 m."""


@dataclass(frozen=True)
class ExportPiece:
    """A table of strokes of another device.

    Attributes:
        table: the strokes.
        boat: the boat in the rower's words, such as "1x"; "" if it is not known.
    """

    table: StrokeTable
    boat: str = ""

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
    def course(self) -> SpeedProfile:
        """What was rowed when."""
        return course_of(self.table)

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which strokes count in averages, (N,): the rowed ones after the starts."""
        return self.course.steady

    @cached_property
    def kind(self) -> str:
        """Sculling, sweep or ergometer; "" if it is not known."""
        return boat_kind(self.table, self.boat)

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Averages over the counted strokes. Their uncertainty is the scatter: a device's errors are not known."""
        known = {name: np.zeros(len(self.table)) for name in self.table.columns}
        return averages(self.table, feature_means(replace(self.table, stds=known), self.counted))

    @cached_property
    def rowed(self) -> Rowed:
        """For findings.

        Where strokes differ by less than the device's rounding, they share its error: it does not average out.
        """
        found = Rowed.of_table(self.table, self.counted, self.kind, self.device)
        steps = {name: resolution(values) for name, values in found.columns.items()}
        stds = {
            name: np.full(len(found.numbers), _shared(found.columns[name], steps[name]))
            for name in found.stds
        }
        least = {}
        for name, watched in WATCHED.items():
            if watched.feature.shown_unit in _OF_FORCE and name in found.columns and found.good(name).any():
                usual = abs(float(np.median(found.columns[name][found.good(name)])))
                least[name] = watched.feature.shown_scale * max(_MATTERS * usual, steps[name])
        return replace(found, stds=stds, least=least)

    @cached_property
    def faded(self) -> dict[str, Faded]:
        """First against last quarter, by column."""
        return faded_of(self.rowed, self.course)


def resolution(values: Floats) -> float:
    """The step to which a device rounds: the smallest difference between two of its numbers (N,); 0 without two."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9 * max(float(np.nanmax(np.abs(values))), 1e-12)] if len(steps) else steps
    return float(steps.min()) if len(steps) else 0.0


def _shared(values: Floats, step: float) -> float:
    """Standard deviation of the rounding that all strokes (N,) share."""
    known = values[np.isfinite(values)]
    return step / float(np.sqrt(12.0)) if len(known) and float(known.std()) < step else 0.0


def device_of(source: str) -> str:
    """The device of an export's source, "FILE: DEVICE, what"."""
    return (source.partition(": ")[2] or source).partition(",")[0]


def boat_kind(table: StrokeTable, boat: str) -> str:
    """Sculling, sweep or ergometer; "" if neither the table nor the name of the boat says it.

    Ergometers measure the handle and no oar. NK's files have the length of the oar.
    """
    if "handle_travel_m" in table and "arc_rad" not in table:
        return "ergometer"
    if _SCULLS.search(boat):
        return "sculling"
    if _SWEEPS.search(boat):
        return "sweep"
    oar = next((found for note in table.notes if (found := _OAR.search(note))), None)
    return "" if oar is None else "sculling" if float(oar[1]) < _LONGEST_SCULL_CM else "sweep"
