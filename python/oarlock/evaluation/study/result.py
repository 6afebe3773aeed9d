"""`StudyResult`: one row for each run and joint, with mean and spread over the seeds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock import _core
from oarlock.evaluation.study.costs import save_costs
from oarlock.evaluation.study.pool import identity
from oarlock.evaluation.study.rows import scores_of, write_rows
from oarlock.evaluation.study.run import MEAN, SCORES, Row
from oarlock.evaluation.study.spec import Study, shown
from oarlock.storage.arrays import Floats
from oarlock.storage.dataframes import columns_of_rows, pandas_table, polars_table
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.notebook_html import card, html_table
from oarlock.storage.statistics import student_quantile
from oarlock.storage.toml import write_toml

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl


CONFIDENCE = 0.95
RUN_FILE = "run.toml"
KIND = "study"


_SHOWN_ROWS = 40
"""Lines of the summary that a notebook shows."""


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Result of a study.

    Args:
        study: the study.
        rows: one row for each run and joint, frame (and its axes), sensor, and one for the mean of the angles. `error`
            gives the reason if scores are missing: the run failed (kind "run"), or the mean lacks a joint. RMSE, bias
            and mean_std are in `unit`: deg or mm.
    """

    study: Study
    rows: tuple[Row, ...]

    @property
    def failures(self) -> tuple[Row, ...]:
        """Rows of the runs that failed."""
        return tuple(row for row in self.rows if row["kind"] == "run")

    @property
    def complaints(self) -> tuple[Row, ...]:
        """Rows with an error: of runs that failed, and of means over joints that are not all observed."""
        return tuple(row for row in self.rows if row["error"])

    def table(self) -> list[Row]:
        """The rows with a column for each swept key."""
        return [self._flat(row) for row in self.rows]

    def summary(self) -> list[Row]:
        """One row for each scenario and item: mean, SD and 95 % interval of the RMSE over the seeds.

        The interval is Student's, of the mean; it and the SD are NaN where fewer than two seeds succeeded.
        """
        found: dict[tuple[int, str, str], list[Row]] = {}
        for row in self.rows:
            if not row["error"]:
                found.setdefault((row["scenario"], row["kind"], row["item"]), []).append(row)
        failed = Counter(row["scenario"] for row in self.failures)
        return [self._summed(rows, failed[scenario]) for (scenario, *_), rows in found.items()]

    def scores(self, item: str = MEAN, score: str = "rmse", kind: str | None = None) -> Floats:
        """One score of one item, (scenarios, seeds); NaN where a run failed or does not have it.

        Args:
            item: a joint, a frame, an axis of it (`r_wrist.x`), a sensor; default: the mean over the angles.
            score: a column of `table`.
            kind: joint, frame, sensor or mean; None uses the first that has this item.
        """
        return scores_of(self.study, self.rows, item, score, kind)

    def to_pandas(self) -> pd.DataFrame:
        """`table` as a pandas DataFrame (needs the extra `oarlock[dataframe]`)."""
        return pandas_table(columns_of_rows(self.table()))

    def to_polars(self) -> pl.DataFrame:
        """`table` as a polars DataFrame (needs the extra `oarlock[polars]`)."""
        return polars_table(columns_of_rows(self.table()))

    def _repr_html_(self) -> str:
        rows = self.summary()
        head = list(rows[0]) if rows else []
        table = html_table(head, [[row[name] for name in head] for row in rows[:_SHOWN_ROWS]])
        more = f", the first {_SHOWN_ROWS} of {len(rows)} lines" if len(rows) > _SHOWN_ROWS else ""
        return card("StudyResult", f"{len(self.rows)} rows, {len(self.failures)} failed runs{more}", table)

    def save(self, folder: str | PathLike[str]) -> None:
        """Write runs and summary as CSV and Parquet, the table of faults if there are any, and run.toml."""
        with replaced_folder(folder, KIND) as place:
            write_rows(self.table(), place / "runs")
            write_rows(self.summary(), place / "summary")
            if self.study.faults:
                save_costs(self.study, self.rows, place)
            write_toml(place / RUN_FILE, _description(self))

    def _flat(self, row: Row) -> Row:
        swept = {key: _cell(value) for key, value in row["swept"].items()}
        return {
            "scenario": row["scenario"],
            "name": row["name"],
            **swept,
            **{key: row[key] for key in ("seed", "kind", "item", "unit", *SCORES, "error")},
        }

    def _summed(self, rows: Sequence[Row], failed: int) -> Row:
        first = rows[0]
        values = np.array([row["rmse"] for row in rows])
        mean, sd, half = mean_and_interval(values)
        swept = {key: _cell(value) for key, value in first["swept"].items()}
        return {
            "scenario": first["scenario"],
            "name": first["name"],
            **swept,
            **{key: first[key] for key in ("kind", "item", "unit")},
            "seeds": len(rows),
            "failed": failed,
            "rmse_mean": mean,
            "rmse_sd": sd,
            "rmse_low_95": mean - half,
            "rmse_high_95": mean + half,
            "rmse_worst": float(values.max()),
            **{f"{key}_mean": _mean(row[key] for row in rows) for key in SCORES if key != "rmse"},
        }


def mean_and_interval(values: Floats) -> tuple[float, float, float]:
    """Mean, SD and half of the 95 % interval of the mean (Student) of (N,); NaN where N is too small."""
    finite = values[np.isfinite(values)]
    count = len(finite)
    if count == 0:
        return math.nan, math.nan, math.nan
    mean = float(finite.mean())
    if count == 1:
        return mean, math.nan, math.nan
    sd = float(finite.std(ddof=1))
    return mean, sd, student_quantile(0.5 + 0.5 * CONFIDENCE, count - 1) * sd / math.sqrt(count)


def _cell(value: Any) -> Any:
    """Numbers stay numbers, None stays empty, everything else becomes text."""
    if value is None:
        return None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else shown(value)


def _mean(values: Iterable[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else math.nan


def _description(result: StudyResult) -> dict[str, object]:
    study = result.study
    plain = {key: _toml(value) for key, value in study.fixed.items() if value is not None}
    return {
        "format": 1,
        "oarlock": _core.__version__,
        "title": study.title,
        "model": study.model.name,
        "parameters": dict(study.model.parameters),
        "simulator": repr(study.simulator),
        "seeds": list(study.seeds),
        "start_s": study.start_s,
        "runs": study.run_count,
        "failed": len(result.failures),
        "identity_sha256": identity(study),
        "fixed": plain,
        "scenario": [
            {"name": s.name, "values": {k: _toml(v) for k, v in s.values.items() if v is not None}}
            for s in study.expanded()
        ],
    }


def _toml(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _toml(one) for key, one in value.items()}
    return [("none" if one is None else one) for one in value] if isinstance(value, list | tuple) else value
