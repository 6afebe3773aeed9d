"""Writes markers as TRC and CSV text with all digits, for `Markers.save` and the exports."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.units import from_held_unit

_LABELS = (
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
)


def frame_rate_hz(time_s: Floats) -> float:
    """Frames per second, to nine digits; NaN for a single frame. If frames are missing, one over the median step."""
    if len(time_s) < 2:
        return float("nan")
    steps = np.diff(time_s)
    # the mean removes the rounding of time stamps to milliseconds
    usual = float(np.median(steps))
    step = steps.mean() if steps.max() < 1.5 * usual else usual
    return float(f"{1.0 / float(step):.9g}")


def trc_text(names: Sequence[str], time_s: Floats, position_m: Floats, file: Path, unit: str = "m") -> str:
    """The file's text, in m or another unit of length, every number with all its digits.

    Raises:
        DataError: a name contains a tab or an end of line.
    """
    for name in names:
        if any(mark in name for mark in "\t\r\n"):
            raise DataError(f"{file}: the marker's name {name!r} contains a tab or an end of line; rename it")
    rate = repr(frame_rate_hz(time_s)) if len(time_s) > 1 else "1.0"
    count, frames = len(names), len(time_s)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{file.name}",
        _LABELS,
        f"{rate}\t{rate}\t{frames}\t{count}\t{unit}\t{rate}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{k}" for k in range(1, count + 1) for axis in "XYZ"),
        "",
    ]
    flat = from_held_unit(position_m.reshape(frames, -1), unit)
    for k in range(frames):
        cells = ("NaN" if np.isnan(value) else repr(float(value)) for value in flat[k])
        lines.append(f"{k + 1}\t{float(time_s[k])!r}\t" + "\t".join(cells))
    return "\n".join(lines) + "\n"


def csv_text(names: Sequence[str], time_s: Floats, position_m: Floats, file: Path) -> str:
    """The file's text, in m, every number with all its digits; an empty cell where a marker was not visible."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for name in names:
        if any(mark in name for mark in "\r\n"):
            raise DataError(f"{file}: the marker's name {name!r} contains an end of line; rename it")
    writer.writerow(["time_s", *(f"{name}_{axis}_m" for name in names for axis in "xyz")])
    for stamp_s, row in zip(time_s, position_m.reshape(len(time_s), -1), strict=True):
        writer.writerow([repr(float(stamp_s)), *("" if np.isnan(v) else repr(float(v)) for v in row)])
    return stream.getvalue()
