"""Scores of a study as arrays, and the files that contain them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from oarlock.evaluation.study.run import MEAN, Row
from oarlock.evaluation.study.spec import Study, shown
from oarlock.storage.arrays import Floats
from oarlock.storage.arrow_csv import write_arrow_csv


def scores_of(
    study: Study, rows: Sequence[Row], item: str = MEAN, score: str = "rmse", kind: str | None = None
) -> Floats:
    """One score of one item, (scenarios, seeds), as `StudyResult.scores` gives it."""
    seeds = {seed: place for place, seed in enumerate(study.seeds)}
    found = np.full((len(study.expanded()), len(seeds)), np.nan)
    for row in rows:
        if row["item"] == item and not row["error"] and row["kind"] == (kind := kind or row["kind"]):
            found[row["scenario"], seeds[row["seed"]]] = row[score]
    return found


def write_rows(rows: Sequence[Row], stem: Path) -> None:
    """Write rows as `stem`.csv and `stem`.parquet; NaN becomes an empty cell or null."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {name: _column([null_if_nan(row.get(name)) for row in rows]) for name in names}
    table = pa.table(columns)
    parquet.write_table(table, stem.with_name(f"{stem.name}.parquet"))
    write_arrow_csv(table, stem.with_name(f"{stem.name}.csv"))


def _column(values: Sequence[Any]) -> pa.Array:
    """One type for each column: text if the values of a key have different types."""
    kinds = {type(value) for value in values if value is not None}
    if str in kinds and len(kinds) > 1:
        return pa.array([None if value is None else shown(value) for value in values])
    return pa.array(values)


def null_if_nan(value: Any) -> Any:
    """None for what is not finite, which JSON and Parquet write as null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
