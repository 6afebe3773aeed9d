"""Reads markers from C3D files with the library ezc3d."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.child_process import arrays_of
from oarlock.formats.marker_table import held_unit, markers_of
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock.evaluation.markers.trajectories import Markers


def read_c3d(file: Path, unit: str | None = None) -> Markers:
    """Read the points of a C3D file.

    A point counts as not visible if its residual is negative, or all its coordinates are 0 or NaN, because writers
    differ. Names are those of `POINT:LABELS`, followed by `LABELS2` and so on; the unit is `POINT:UNITS`. The time
    stamp of a frame is (number - 1) / rate, so a cut file keeps the time of the whole trial.

    Source: The C3D File Format, a technical user guide (Motion Lab Systems 2021), parameter section POINT.

    Raises:
        DataError: ezc3d is not installed, or the file cannot be read or contains no points.
    """
    if find_spec("ezc3d") is None:
        raise DataError(
            f"{file}: C3D files are read with ezc3d: pip install 'oarlock[c3d]' (or export the markers as TRC)"
        )
    content = arrays_of("c3d", file)
    raw, rate = content["points"], float(content["rate_hz"])
    count, frames = raw.shape[1:]
    if not count or not frames:
        raise DataError(f"{file}: contains {count} points in {frames} frames; nothing to read")
    position = np.where(_unseen(raw, content["residuals"]), np.nan, raw)
    names = _names(content["labels"], count, file)
    if not rate > 0.0:
        raise DataError(
            f"{file}: the rate of its points is {rate:g} Hz; expected a positive number (POINT:RATE)"
        )
    time_s = (int(content["first_frame"]) + np.arange(frames)) / rate
    held = held_unit(str(content["unit"]), unit, f"{file}, POINT:UNITS")
    return markers_of(file, names, time_s, position.transpose(2, 1, 0).reshape(frames, -1), held)


def _unseen(raw: Floats, residual: Floats) -> Any:
    return (residual < 0.0) | np.isnan(raw).any(axis=0) | (raw == 0.0).all(axis=0)


def _names(labels: NDArray[Any], count: int, file: Path) -> tuple[str, ...]:
    if len(labels) < count:
        raise DataError(f"{file}: has {count} points but {len(labels)} labels (POINT:LABELS)")
    return tuple(str(label) or f"unnamed_{k + 1}" for k, label in enumerate(labels[:count]))
