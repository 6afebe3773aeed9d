"""Writes a track's columns and the positions of its frames as CSV and Parquet, each column with its unit."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from oarlock._core import __version__
from oarlock.storage import csv_cells
from oarlock.storage.arrays import Floats
from oarlock.storage.extras import FULL, optional
from oarlock.tracking.columns import unit_of

if TYPE_CHECKING:
    from oarlock.evaluation.markers.trajectories import Markers
    from oarlock.tracking.track import Track

Columns = Mapping[str, Floats]


def told_columns(track: Track) -> dict[str, Floats]:
    """The columns of a track without those that have no number, such as velocities of joints that have none."""
    return {name: values for name, values in track.columns().items() if np.isfinite(values).any()}


def frame_columns(frames: Markers) -> dict[str, Floats]:
    """`time_s`, then `NAME_x_m`, `NAME_y_m`, `NAME_z_m` of each frame, (T,) each."""
    found = {"time_s": frames.time_s}
    for k, name in enumerate(frames.names):
        found |= {f"{name}_{axis}_m": frames.position_m[:, k, i] for i, axis in enumerate("xyz")}
    return found


def angle_columns(columns: Columns) -> dict[str, Floats]:
    """Angles in deg and lengths in cm with their standard deviations: `elbow_deg`, `seat_std_cm`."""
    found = {"time_s": columns["time_s"]}
    for name, values in columns.items():
        shown = re.fullmatch(r"([^.]+)_(rad)|(.+)_(m)", name)  # components of rotation vectors have a dot
        if shown is not None:
            unit, factor = ("deg", 180.0 / np.pi) if shown[2] else ("cm", 100.0)
            found[f"{shown[1] or shown[3]}_{unit}"] = factor * values
    return found


def write_csv(columns: Columns, file: Path) -> None:
    """One header line with units in the names; every number with all its digits, an empty cell where there is none."""
    csv_cells.write_csv(columns, file)


def write_parquet(columns: Columns, file: Path, about: Mapping[str, str | Sequence[str]]) -> None:
    """Writes float64, NaN where missing.

    Each column's metadata has its `unit`, the table's has `about` (lists as JSON).
    """
    pa = optional("pyarrow", FULL, "export: metadata of columns")
    parquet = optional("pyarrow.parquet", FULL, "export: metadata of columns")
    fields = [pa.field(name, pa.float64(), metadata={"unit": unit_of(name)}) for name in columns]
    said = {key: text if isinstance(text, str) else json.dumps(list(text)) for key, text in about.items()}
    schema = pa.schema(fields, metadata={"oarlock": __version__, **said})
    parquet.write_table(pa.table(dict(columns), schema=schema), file)
