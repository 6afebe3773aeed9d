"""`Efforts`: mean boat speed or power of an athlete's pieces, from devices' exports of the same time, for `earlier`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oarlock.season.questions.database import Database

Floats = NDArray[np.float64]

MEASURES = {"sculling": "speed_m_s", "sweep": "speed_m_s", "ergometer": "power_w"}
"""The number that says how fast a piece was, by kind of rowing."""
COVERED = 0.8
"""Smallest share of a piece from the export's first to its last stroke in it."""
_TIMES = ("end_time_s", "finish_time_s", "time_s")
_RATES_PER_MIN = (14.0, 50.0)
"""Strokes outside are paddling or misread, as in `rowing.alongside.stretches`."""
_FEWEST = 6


@dataclass(frozen=True, eq=False)
class Efforts:
    """Strokes of the devices that measured an athlete's pace.

    Attributes:
        measure: column of the numbers.
        exports: of each export the end of each stroke, s since 1970, and its number, (N,) each.
    """

    measure: str
    exports: tuple[tuple[Floats, Floats], ...]

    @classmethod
    def of(cls, database: Database, kind: str) -> Efforts:
        """Those of the one athlete whom the database was opened for.

        An export whose clock restarts is left out: when its strokes were rowed is not known.
        """
        measure = MEASURES[kind]
        columns = set(database.table("DESCRIBE strokes")["column_name"].to_pylist())
        times = [name for name in _TIMES if name in columns]
        if not times or not {measure, "rate_per_min"} <= columns:
            return cls(measure, ())
        low, high = _RATES_PER_MIN
        rows = database.table(
            f"SELECT s.recording, epoch(s.started) + coalesce({', '.join(times)}) AS at_s, {measure}::DOUBLE AS value "
            "FROM strokes s JOIN recordings r USING (recording) "
            f"WHERE r.kind = 'export' AND s.started IS NOT NULL AND {measure} > 0 "
            f"AND rate_per_min BETWEEN {low} AND {high} ORDER BY s.recording, stroke"
        )
        return cls(measure, tuple(_exports(rows.to_pydict())))

    def during(self, start_s: float, end_s: float) -> float:
        """Mean over a piece, of the export that covers most of it; NaN without one. Moments in s since 1970."""
        best, covered = float("nan"), COVERED * (end_s - start_s)
        for at_s, value in self.exports:
            inside = (at_s >= start_s) & (at_s <= end_s)
            if inside.sum() >= _FEWEST and (length := float(np.ptp(at_s[inside]))) >= covered:
                best, covered = float(np.mean(value[inside])), length
        return best


def _exports(rows: dict[str, list[object]]) -> Iterator[tuple[Floats, Floats]]:
    at_s, value = (np.array(rows[name], dtype=np.float64) for name in ("at_s", "value"))
    names = np.array(rows["recording"], dtype=str)
    for name in np.unique(names):
        own = (names == name) & np.isfinite(at_s)
        if (np.diff(at_s[own]) > 0.0).all():
            yield at_s[own], value[own]
