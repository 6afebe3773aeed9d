"""C3D files, through the library ezc3d."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.array_gate import FloatArray
from oarlock.errors import DataError
from oarlock.io.c3d_layout import check_layout
from oarlock.io.marker_table import held_unit, markers_of

if TYPE_CHECKING:
    from oarlock.markers.trajectories import Markers


def read_c3d(file: Path, unit: str | None = None) -> Markers:
    """Read the points of a C3D file.

    A point counts as not seen where its residual is negative, or all its coordinates are 0 or NaN: writers differ.
    Names are `POINT:LABELS` with those of `LABELS2` and so on behind them; the unit is `POINT:UNITS`. The stamp of a
    frame is its number less one over the rate, so a cut file keeps the time of the whole trial.

    Source: The C3D File Format, a technical user guide (Motion Lab Systems 2021), parameter section POINT.

    Raises:
        DataError: ezc3d is not installed, or the file cannot be read or holds no points.
    """
    content = _content(file)
    point = content["parameters"]["POINT"]
    raw = np.asarray(content["data"]["points"], dtype=np.float64)[:3]
    count, frames = raw.shape[1:]
    if not count or not frames:
        raise DataError(f"{file}: holds {count} points in {frames} frames; nothing to read")
    residual = np.asarray(content["data"]["meta_points"]["residuals"], dtype=np.float64)[0]
    position = np.where(_unseen(raw, residual), np.nan, raw)
    names = _labels(point, count, file)
    said = str(_first(point, "UNITS") or "")
    rate = float(content["header"]["points"]["frame_rate"])
    if not rate > 0.0:
        raise DataError(
            f"{file}: the rate of its points is {rate:g} Hz; expected a positive number (POINT:RATE)"
        )
    first = int(content["header"]["points"]["first_frame"])
    time_s = (first + np.arange(frames)) / rate
    held = held_unit(said, unit, f"{file}, POINT:UNITS")
    return markers_of(file, names, time_s, position.transpose(2, 1, 0).reshape(frames, -1), held)


def _content(file: Path) -> Any:
    try:
        import ezc3d
    except ImportError:
        raise DataError(
            f"{file}: C3D files are read with ezc3d: pip install 'oarlock[c3d]' (or export the markers as TRC)"
        ) from None
    try:
        check_layout(file.read_bytes(), file)
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from error
    try:
        return ezc3d.c3d(str(file))
    except Exception as error:  # ezc3d raises whatever its C++ side throws
        raise DataError(f"{file}: is no C3D file, or is damaged ({error})") from error


def _unseen(raw: FloatArray, residual: FloatArray) -> Any:
    return (residual < 0.0) | np.isnan(raw).any(axis=0) | (raw == 0.0).all(axis=0)


def _labels(point: Any, count: int, file: Path) -> tuple[str, ...]:
    """All labels: a C3D parameter holds 255, so large sets go on in LABELS2, LABELS3, ..."""
    found: list[str] = []
    for number in range(1, 100):
        key = "LABELS" if number == 1 else f"LABELS{number}"
        if key not in point:
            break
        found += [str(label).strip() for label in point[key]["value"]]
    if len(found) < count:
        raise DataError(f"{file}: has {count} points but {len(found)} labels (POINT:LABELS)")
    return tuple(label or f"unnamed_{k + 1}" for k, label in enumerate(found[:count]))


def _first(point: Any, key: str) -> Any:
    values = point[key]["value"] if key in point else []
    return values[0] if len(values) else None
