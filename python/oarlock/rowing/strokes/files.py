"""Writes a table of strokes as CSV for people and as Parquet, with reasons and curves, for programs."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.folder_writer import replaced_folder

CSV_NAME = "strokes.csv"
PARQUET_NAME = "strokes.parquet"
KIND = "strokes"


def save_strokes(table: StrokeTable, folder: str | PathLike[str], force: bool = False) -> tuple[Path, Path]:
    """Write `strokes.csv` and `strokes.parquet`, SI and radians; makes the folder.

    Strokes that were saved there before are replaced; files that are not Oarlock's only if `force` is set.

    The Parquet file holds each column and its `NAME_std`, as `NAME_reason` why a number is missing, and of each curve
    `NAME_curve` (K values a stroke) and, where the curve tells, `NAME_curve_at` (the time or place of each). Its
    metadata hold `source`, `notes` and, of each field, what it means.

    Returns:
        The two files.
    """
    with replaced_folder(folder, KIND, force) as place:
        table.to_csv(place / CSV_NAME)
        pq.write_table(_arrow(table), place / PARQUET_NAME)
    return Path(folder) / CSV_NAME, Path(folder) / PARQUET_NAME


def _arrow(table: StrokeTable) -> pa.Table:
    columns: dict[str, pa.Array] = {}
    for name, values in table.columns.items():
        columns[name] = pa.array(values, mask=np.isnan(values))
        if name in table.stds:
            columns[f"{name}_std"] = pa.array(table.stds[name], mask=np.isnan(table.stds[name]))
        if name in table.reasons:
            columns[f"{name}_reason"] = pa.array(list(table.reasons[name]), type=pa.string())
    for name, curves in table.curves.items():
        plain = [np.asarray(curve, dtype=np.float64) for curve in curves]
        columns[f"{name}_curve"] = pa.array([c if c.ndim == 1 else c[:, 1] for c in plain], type=_LIST)
        if any(curve.ndim == 2 for curve in plain):
            columns[f"{name}_curve_at"] = pa.array(
                [c[:, 0] if c.ndim == 2 else [] for c in plain], type=_LIST
            )
    fields = [pa.field(name, array.type, metadata=_meaning(name)) for name, array in columns.items()]
    about = {"source": table.source, "notes": json.dumps(list(table.notes), ensure_ascii=False)}
    return pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields, metadata=about))


_LIST = pa.list_(pa.float64())


def _meaning(name: str) -> dict[str, str]:
    return {"meaning": FEATURES[name].in_words} if name in FEATURES else {}
