"""`StrokeTable`: one row per stroke, columns by quantity and unit, reasons for missing numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from oarlock.rowing.analysis.features import FEATURES
from oarlock.storage.arrays import Floats
from oarlock.storage.csv_cells import inert
from oarlock.storage.dataframes import pandas_table, polars_table
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl


@dataclass(frozen=True, eq=False)
class StrokeTable:
    """One row per stroke; (N,) each. An unknown number is NaN, with its reason.

    Args:
        columns: numbers by name, SI and radians. `oarlock.rowing.FEATURES` explains the names; others are allowed.
        stds: standard deviations by the same names; a column without them has none that is known.
        reasons: by the same names, a sentence a row: why the number is NaN, or what to know of it; "" where nothing is.
        curves: by name, an array (K,) or (K, 2) a stroke, whose lengths may differ.
        source: what the strokes come from, for people.
        notes: plain sentences on what was missing or odd.
        epoch: the moment of 0 s of its times, as `Recording.epoch`; "" if it is not known.
        onset: what the device takes as the begin of a stroke, for people; "" if it does not say.

    Raises:
        DataError: columns of different lengths, or deviations, reasons or curves that belong to none.
    """

    columns: Mapping[str, Floats]
    stds: Mapping[str, Floats] = field(default_factory=dict)
    reasons: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    curves: Mapping[str, tuple[Floats, ...]] = field(default_factory=dict)
    source: str = ""
    notes: tuple[str, ...] = ()
    epoch: str = ""
    onset: str = ""

    def __post_init__(self) -> None:
        for name in ("columns", "stds"):
            held = {key: _column(name, key, values) for key, values in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(held))
        for name in ("reasons", "curves"):
            held_rows = {key: tuple(rows) for key, rows in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(held_rows))
        object.__setattr__(self, "notes", tuple(self.notes))
        self._check()

    def _check(self) -> None:
        if not self.columns:
            raise DataError("a stroke table needs at least one column")
        for kind in ("columns", "stds", "reasons", "curves"):
            for name, rows in getattr(self, kind).items():
                if len(rows) != len(self):
                    first = next(iter(self.columns))
                    raise DataError(
                        f"stroke table, {kind} of '{name}': has {len(rows)} rows, but '{first}' has {len(self)}. "
                        "Give one row per stroke"
                    )
                if kind in ("stds", "reasons") and name not in self.columns:
                    raise DataError(f"stroke table: {kind} of '{name}', but there is no such column")

    def to_pandas(self) -> pd.DataFrame:
        """One row per stroke as a pandas DataFrame (needs the extra `oarlock[dataframe]`)."""
        return pandas_table(self.columns)

    def to_polars(self) -> pl.DataFrame:
        """One row per stroke as a polars DataFrame (needs the extra `oarlock[polars]`). Missing numbers are NaN."""
        return polars_table(self.columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def __getitem__(self, name: str) -> Floats:
        """The column of this name, (N,)."""
        if name not in self.columns:
            raise KeyError(f"no column '{name}'; there are {', '.join(self.columns)}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    @property
    def stamp_s(self) -> Floats:
        """When the distance of each row was read (N,), s: the logger's time, else the next catch, else the finish."""
        found = np.full(len(self), np.nan)
        for name in ("time_s", "end_time_s", "finish_time_s"):
            if name in self:
                found = np.where(np.isnan(found), self[name], found)
        return found

    @property
    def clock_s(self) -> Floats:
        """As `stamp_s`, (N,), on one clock: where a logger's restarts, times go on from the last.

        The pause between is not known.
        """
        return running(self.stamp_s)

    @property
    def duration_s(self) -> float | None:
        """From 0 s of its times to the end of the last stroke; None without times."""
        clock_s = self.clock_s
        return float(np.nanmax(clock_s)) if np.isfinite(clock_s).any() else None

    def std(self, name: str) -> Floats:
        """Standard deviations (N,) of a column; NaN where they are not known."""
        return self.stds[name] if name in self.stds else np.full(len(self[name]), np.nan)

    def reason(self, name: str) -> tuple[str, ...]:
        """Why numbers of a column are NaN or doubtful, a sentence a row; "" where there is nothing to say."""
        return self.reasons.get(name, ("",) * len(self))

    def to_rows(self) -> list[dict[str, float]]:
        """A dict a stroke: every column, and every known standard deviation as `NAME_std`."""
        named = self._flat()
        return [{name: float(values[row]) for name, values in named.items()} for row in range(len(self))]

    def to_csv(self, path: str | PathLike[str], explained: bool = True) -> None:
        """Write the columns and their standard deviations (`NAME_std`), a line a stroke; an unknown is an empty cell.

        Args:
            path: of the file.
            explained: lines that begin with # before the header say what each column means, and why cells are empty.
        """
        named = self._flat()
        text = io.StringIO(newline="")
        if explained:
            text.writelines(f"# {line}\n" for line in self._explanations())
        writer = csv.writer(text)
        writer.writerow(map(inert, named))
        for row in range(len(self)):
            writer.writerow([_cell(values[row]) for values in named.values()])
        write_file(Path(path), text.getvalue())

    def _flat(self) -> dict[str, Floats]:
        flat: dict[str, Floats] = {}
        for name, values in self.columns.items():
            flat[name] = values
            if name in self.stds:
                flat[f"{name}_std"] = self.stds[name]
        return flat

    def _explanations(self) -> list[str]:
        lines = [self.source] if self.source else []
        lines += list(self.notes)
        for name in self.columns:
            if name in FEATURES:
                lines.append(f"{name}: {FEATURES[name].in_words}")
            missing = dict.fromkeys(text for text in self.reason(name) if text)
            lines += [f"{name}: {text}" for text in missing]
        return [" ".join(line.split()) for line in lines]


def _column(kind: str, name: str, values: object) -> Floats:
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1:
        raise DataError(
            f"stroke table, {kind} of '{name}': has shape {array.shape}; give one number a stroke"
        )
    array.flags.writeable = False
    return array


def running(time_s: Floats) -> Floats:
    """Times (N,) of a clock that restarts, as those of one that does not; a single one that is too small is NaN."""
    known = np.flatnonzero(np.isfinite(time_s))
    kept = time_s[known]
    dips = np.flatnonzero((kept[1:-1] < kept[:-2]) & (kept[2:] >= kept[:-2])) + 1
    known, kept = np.delete(known, dips), np.delete(kept, dips)
    before = np.append(0.0, kept[:-1])
    run: Floats = np.full(len(time_s), np.nan)
    run[known] = kept + np.cumsum(np.where(kept < before, before, 0.0))
    return run


def _cell(value: np.float64) -> str:
    return "" if np.isnan(value) else f"{value:.10g}"
