"""Plain data of a part of the reproduction, for the page, the terminal and the tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from oarlock.storage.arrays import Floats

Row = dict[str, Any]
Mark = Literal["", "met", "missed"]
Verdict = Literal["holds", "holds in part", "does not hold", "not checked"]


@dataclass(frozen=True)
class Cell:
    """One cell: our value with its spread over seeds, the printed value, and whether a bound is met."""

    ours: str
    paper: str = ""
    spread: str = ""
    bound: str = ""
    mark: Mark = ""


@dataclass(frozen=True)
class Table:
    """Rows under a header; the first cell of a row is its name. A closed table is folded on the page."""

    key: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    closed: bool = False


@dataclass(frozen=True)
class EstimateCurve:
    """An estimate (T,) with half of its 95 % band, and the truth; in `unit`."""

    name: str
    unit: str
    time_s: Floats
    value: Floats
    half_band: Floats
    truth: Floats
    note: str = ""


@dataclass(frozen=True)
class Chart:
    """Points (x, y) by series on two logarithmic axes."""

    key: str
    caption: str
    x_name: str
    y_name: str
    series: Mapping[str, tuple[Floats, Floats]]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, the check, its result and the verdict."""

    source: str
    sentence: str
    done: str
    result: str
    verdict: Verdict


@dataclass(frozen=True)
class PaperPart:
    """A reproduced table, figure or section of the paper."""

    key: str
    title: str
    lead: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    curves: Mapping[str, tuple[EstimateCurve, ...]] = field(default_factory=dict)
    charts: tuple[Chart, ...] = ()
    claims: tuple[Claim, ...] = ()
    notes: tuple[str, ...] = ()
    data: Mapping[str, Sequence[Row]] = field(default_factory=dict)

    @property
    def marks(self) -> tuple[int, int]:
        """Number of bounds that are met, and number of bounds."""
        result = [c.mark for table in self.tables for row in table.rows for c in row if c.mark]
        return result.count("met"), len(result)


def rounded(value: float, digits: int = 3) -> str:
    """A number with some significant digits; a dash for NaN."""
    if not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if abs(value) >= 1e5:
        return f"{value:.0e}".replace("e+0", "e")
    places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{places}f}"


def finite_mean(values: Sequence[float] | Floats) -> float:
    """Mean of the finite values; NaN without any."""
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    return float(finite.mean()) if len(finite) else math.nan


def finite_sd(values: Sequence[float] | Floats) -> float:
    """Standard deviation of the finite values; NaN for fewer than two."""
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    return float(finite.std(ddof=1)) if len(finite) > 1 else math.nan


def spread(values: Sequence[float] | Floats) -> str:
    """`± 0.01`, empty for a single value."""
    sd = finite_sd(values)
    return f"± {rounded(sd, 2)}" if math.isfinite(sd) else ""
