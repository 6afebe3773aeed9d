"""What the comparison of one data set found: tables, curves and texts, for the page and the file of figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from oarlock.storage.arrays import Floats

from .estimate import Missing, OrientationEstimate, Outcome

Cell = float | int | str | None


@dataclass(frozen=True)
class ResultRow:
    """One line of a table: a software with its figures, or with why there are none."""

    name: str
    cells: tuple[Cell, ...]
    note: str = ""
    ours: bool = False
    online: bool = True


@dataclass(frozen=True)
class ResultTable:
    """Figures of several software packages under one rule.

    Args:
        title: what is scored.
        columns: heads of the figures' columns.
        rows: the lines.
        unit: of the figures, "" where the heads say it.
        digits: decimals on the page.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[ResultRow, ...]
    unit: str = "deg"
    digits: int = 2
    text: str = ""


@dataclass(frozen=True, eq=False)
class ResultCurve:
    """One line of a plot, NaN where it is broken."""

    name: str
    time_s: Floats
    values: Floats
    kind: str = "other"  # "ours", "other" or "reference"


Panel = tuple[str, tuple[ResultCurve, ...]]
"""Label of the vertical axis with its unit, and the curves."""


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves over time, one panel above the other on the same axis.

    Args:
        name: unique, for file and anchor names.
        title: what is seen.
        panels: from top to bottom.
    """

    name: str
    title: str
    panels: tuple[Panel, ...]


@dataclass(frozen=True)
class SetResult:
    """All of one data set.

    Args:
        name: key in the file of figures.
        title: heading on the page.
        text: what the data are and how they are scored.
        absent: why nothing was run; "" if it was.
    """

    name: str
    title: str
    text: str
    tables: tuple[ResultTable, ...] = ()
    plots: tuple[Plot, ...] = ()
    notes: tuple[str, ...] = ()
    absent: str = ""


@dataclass
class Collected:
    """Figures of several trials, gathered trial by trial into one line a software.

    A software that is missing in one trial has an empty cell there.
    """

    columns: list[str] = field(default_factory=list)
    figures: dict[str, dict[str, Cell]] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    ours: dict[str, bool] = field(default_factory=dict)
    online: dict[str, bool] = field(default_factory=dict)

    def add(self, outcome: Outcome, figures: Mapping[str, Cell]) -> None:
        """The figures of one outcome by column; none for a missing one."""
        self.put(
            outcome.name,
            figures,
            outcome.reason if isinstance(outcome, Missing) else outcome.note,
            outcome.ours,
        )
        self.online[outcome.name] = not isinstance(outcome, OrientationEstimate) or outcome.online

    def put(self, name: str, figures: Mapping[str, Cell], note: str = "", ours: bool = False) -> None:
        """More figures of the line with this name."""
        row = self.figures.setdefault(name, {})
        self.ours[name] = ours
        if note and note not in self.notes.get(name, ""):
            self.notes[name] = "; ".join(t for t in (self.notes.get(name), note) if t)
        self.columns += [column for column in figures if column not in self.columns]
        row.update(figures)

    def table(
        self, title: str, *, mean: bool = False, unit: str = "deg", digits: int = 2, text: str = ""
    ) -> ResultTable:
        """All lines, ours first; with the mean over the columns as last column on request."""
        order = sorted(self.figures, key=lambda name: not self.ours[name])
        rows = []
        for name in order:
            cells: list[Cell] = [self.figures[name].get(column) for column in self.columns]
            if mean:
                cells.append(_mean(cells))
            online = self.online.get(name, True)
            rows.append(ResultRow(name, tuple(cells), self.notes.get(name, ""), self.ours[name], online))
        columns = (*self.columns, *(("mean",) if mean else ()))
        return ResultTable(title, columns, tuple(rows), unit, digits, text)


def _mean(cells: Sequence[Cell]) -> float | None:
    numbers = [c for c in cells if isinstance(c, float) and np.isfinite(c)]
    return float(np.mean(numbers)) if numbers and len(numbers) == len(cells) else None
