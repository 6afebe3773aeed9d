"""Writes a table of strokes as CSV for people and as Parquet, with reasons and curves, and reads the Parquet file."""

from __future__ import annotations

import io
import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.extras import FULL, optional
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.parquet_table import Texts, read_table
from oarlock.storage.regular_file import read_bytes

if TYPE_CHECKING:
    import pyarrow as pa

CSV_NAME = "strokes.csv"
PARQUET_NAME = "strokes.parquet"
KIND = "strokes"


def save_strokes(table: StrokeTable, folder: str | PathLike[str], force: bool = False) -> tuple[Path, Path]:
    """Write `strokes.csv` and `strokes.parquet`, SI and radians; makes the folder.

    Strokes that were saved there before are replaced; files that are not Oarlock's only if `force` is set.

    The Parquet file holds each column and its `NAME_std`, as `NAME_reason` why a number is missing, and of each curve
    `NAME_curve` (K values a stroke) and, where the curve tells, `NAME_curve_at` (the time or place of each). Its
    metadata hold `source`, `notes`, `epoch` if it is known and, of each field, what it means.

    Returns:
        The two files.
    """
    with replaced_folder(folder, KIND, force) as place:
        table.to_csv(place / CSV_NAME)
        (place / PARQUET_NAME).write_bytes(strokes_parquet(table))
    return Path(folder) / CSV_NAME, Path(folder) / PARQUET_NAME


def strokes_parquet(table: StrokeTable) -> bytes:
    """The contents of `strokes.parquet`."""
    parquet = optional("pyarrow.parquet", FULL, PARQUET_NAME)
    out = io.BytesIO()
    parquet.write_table(_arrow(table), out)
    return out.getvalue()


def _arrow(table: StrokeTable) -> pa.Table:
    import pyarrow as pa

    lists = pa.list_(pa.float64())
    columns: dict[str, pa.Array] = {}
    for name, values in table.columns.items():
        columns[name] = pa.array(values, mask=np.isnan(values))
        if name in table.stds:
            columns[f"{name}_std"] = pa.array(table.stds[name], mask=np.isnan(table.stds[name]))
        if name in table.reasons:
            columns[f"{name}_reason"] = pa.array(list(table.reasons[name]), type=pa.string())
    for name, curves in table.curves.items():
        plain = [np.asarray(curve, dtype=np.float64) for curve in curves]
        columns[f"{name}_curve"] = pa.array([c if c.ndim == 1 else c[:, 1] for c in plain], type=lists)
        if any(curve.ndim == 2 for curve in plain):
            columns[f"{name}_curve_at"] = pa.array(
                [c[:, 0] if c.ndim == 2 else [] for c in plain], type=lists
            )
    fields = [pa.field(name, array.type, metadata=_meaning(name)) for name, array in columns.items()]
    about = {"source": table.source, "notes": json.dumps(list(table.notes), ensure_ascii=False)}
    if table.epoch:
        about["epoch"] = table.epoch
    return pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields, metadata=about))


def load_strokes(path: str | PathLike[str]) -> StrokeTable:
    """The strokes of a `strokes.parquet` that `save_strokes` wrote, without their curves.

    Args:
        path: the file, or its folder.

    Raises:
        DataError: it cannot be read, or is no such file.
    """
    given = Path(path)
    file = given / PARQUET_NAME if given.is_dir() else given
    return parsed_strokes(read_bytes(file), str(file))


def parsed_strokes(contents: bytes, where: str) -> StrokeTable:
    """As `load_strokes`, of the contents of a file; errors begin with `where`.

    Raises:
        DataError: they are no such file.
    """
    table = read_table(contents, where=where, without_lists=True)
    about = table.about
    numbers = {
        name: values
        for name, values in table.columns.items()
        if not isinstance(values, Texts) and values.dtype.kind == "f"
    }
    stds = {name: numbers.pop(f"{name}_std") for name in list(numbers) if f"{name}_std" in numbers}
    reasons = {name: table.texts(f"{name}_reason") for name in numbers if f"{name}_reason" in table.columns}
    return StrokeTable(
        numbers,
        stds,
        {name: tuple(text or "" for text in texts.rows()) for name, texts in reasons.items()},
        source=about.get("source", Path(where).name),
        notes=_notes(about.get("notes", "[]")),
        epoch=about.get("epoch", ""),
    )


def _notes(text: str) -> tuple[str, ...]:
    try:
        return tuple(str(note) for note in json.loads(text))
    except (ValueError, TypeError):
        return ()


def _meaning(name: str) -> dict[str, str]:
    return {"meaning": FEATURES[name].in_words} if name in FEATURES else {}
