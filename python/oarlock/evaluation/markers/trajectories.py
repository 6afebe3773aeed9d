"""`Markers`: positions of optical markers over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from oarlock.evaluation.markers.texts import csv_text, frame_rate_hz, trc_text
from oarlock.storage.array_gate import check_no_infinity, real_array, time_array
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.write_file import write_file

NamedAxes = Literal["y-up-from-z-up", "z-up-from-y-up"]

ROTATION_TOLERANCE: Final = 1e-6
"""Tolerance of R'R = 1: it accepts matrices with six digits, and rejects scales and reflections."""

_NAMED_AXES: Mapping[str, tuple[tuple[float, ...], ...]] = MappingProxyType(
    {
        "y-up-from-z-up": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        "z-up-from-y-up": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    }
)


@dataclass(frozen=True, eq=False, repr=False)
class Markers:
    """Trajectories of optical markers. Immutable: methods return new objects.

    Args:
        names: names of the markers, each once.
        time_s: (T,) strictly increasing time stamps, s.
        position_m: (T, n, 3) in the axes of the measuring system (or those after `turned`), m; NaN where a marker was
            not visible.

    Raises:
        DataError: a wrong shape, time stamps out of order, a name that is empty or occurs twice, an infinite value, or
            a marker with only some of its three coordinates at an instant.
    """

    names: tuple[str, ...]
    time_s: Floats
    position_m: Floats

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.names)
        if not names or not all(name.strip() for name in names):
            raise DataError(f"markers: names are {names!r}; every marker needs a name that is not empty")
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise DataError(
                f"markers: the name {twice[0]!r} comes {names.count(twice[0])} times; names are unique"
            )
        time_s = time_array(self.time_s, "markers, time_s")
        position = real_array(self.position_m, (None, len(names), 3), "markers, position_m")
        if len(position) != len(time_s):
            raise DataError(f"markers: position_m has {len(position)} rows, but time_s has {len(time_s)}")
        check_no_infinity(position, time_s, "markers, position_m")
        _refuse_parts(names, time_s, position)
        for field, value in (("names", names), ("time_s", time_s), ("position_m", position)):
            object.__setattr__(self, field, value)

    def __len__(self) -> int:
        return len(self.time_s)

    def __getitem__(self, name: str) -> Floats:
        """Positions (T, 3) of one marker, m."""
        return self.position_m[:, self.index(name)]

    def __repr__(self) -> str:
        return (
            f"Markers({len(self.names)} markers, {len(self)} frames, {self.rate_hz:.4g} Hz, {self.time_s[0]:.6g} to "
            f"{self.time_s[-1]:.6g} s, {100 * (1 - self.seen.mean()):.1f} % missing)"
        )

    @property
    def rate_hz(self) -> float:
        """Frames per second; NaN for a single frame. If frames are missing, the reciprocal of the median step."""
        return frame_rate_hz(self.time_s)

    @property
    def seen(self) -> Bools:
        """Whether a marker was visible, (T, n)."""
        there: Bools = np.isfinite(self.position_m[:, :, 0])
        return there

    @property
    def middle_m(self) -> Floats:
        """Mean position of each marker, (n, 3), m; NaN if never visible."""
        count = self.seen.sum(axis=0)[:, None]
        total = np.where(self.seen[:, :, None], self.position_m, 0.0).sum(axis=0)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))

    def index(self, name: str) -> int:
        """Index of a marker among the names.

        Raises:
            DataError: there is none of this name.
        """
        if name not in self.names:
            raise DataError(f'markers: there is no "{name}". {did_you_mean(name, self.names)}')
        return self.names.index(name)

    def select(self, names: Iterable[str] | Mapping[str, str]) -> Markers:
        """Some of the markers, in the given order; a mapping `{name here: new name}` renames them.

        Raises:
            DataError: there is no marker of a name.
        """
        chosen = dict(names) if isinstance(names, Mapping) else {name: name for name in names}
        columns = [self.index(name) for name in chosen]
        return Markers(tuple(chosen.values()), self.time_s, self.position_m[:, columns])

    def between(self, start_s: float, end_s: float) -> Markers:
        """The frames from `start_s` to `end_s`, both included.

        Raises:
            DataError: there is none.
        """
        kept = (self.time_s >= start_s) & (self.time_s <= end_s)
        if not kept.any():
            raise DataError(
                f"markers: no frame lies between {start_s:g} and {end_s:g} s; they last from {self.time_s[0]:g} to "
                f"{self.time_s[-1]:g} s"
            )
        return Markers(self.names, self.time_s[kept], self.position_m[kept])

    def turned(self, axes: NamedAxes | ArrayLike) -> Markers:
        """The same points in other axes.

        Args:
            axes: rotation (3, 3) from the present to the new coordinates, or a name: `y-up-from-z-up` (x stays, z
                becomes y) or `z-up-from-y-up`.

        Raises:
            DataError: an unknown name, or a matrix that is no rotation.
        """
        return Markers(self.names, self.time_s, self.position_m @ rotation_of(axes).T)

    def moved(self, wanted_from_here: ArrayLike) -> Markers:
        """The same points after a rigid displacement (4, 4).

        Raises:
            DataError: the matrix is not a rigid displacement.
        """
        pose = real_array(wanted_from_here, (4, 4), "markers, wanted_from_here")
        rotation = rotation_of(pose[:3, :3])
        return Markers(self.names, self.time_s, self.position_m @ rotation.T + pose[:3, 3])

    def save(self, path: str | PathLike[str]) -> None:
        """Write a `.trc` or `.csv` file in m; reading it gives the same bits.

        Raises:
            DataError: another file extension, or the file cannot be written.
        """
        file = Path(path)
        writers = {".trc": trc_text, ".csv": csv_text}
        if file.suffix.lower() not in writers:
            raise DataError(f"{file}: markers are written as .trc or .csv")
        text = writers[file.suffix.lower()](self.names, self.time_s, self.position_m, file)
        write_file(file, text)


def rotation_of(axes: NamedAxes | ArrayLike) -> Floats:
    """The rotation (3, 3) for a name or a matrix.

    Raises:
        DataError: an unknown name, or a matrix that is no rotation.
    """
    if isinstance(axes, str):
        if axes not in _NAMED_AXES:
            raise DataError(
                f'axes: there is no "{axes}". {did_you_mean(axes, _NAMED_AXES)} Or give a 3x3 rotation.'
            )
        return np.array(_NAMED_AXES[axes], dtype=np.float64)
    given = real_array(axes, (3, 3), "axes")
    off = float(np.abs(given.T @ given - np.eye(3)).max())
    if not off <= ROTATION_TOLERANCE or np.linalg.det(given) < 0.0:
        raise DataError(
            f"axes: {given.tolist()} is no rotation (R'R is off by {off:.2g}, determinant {np.linalg.det(given):.3g}). "
            "Columns are the old axes in the new ones; a mirror is not allowed."
        )
    return given


def _refuse_parts(names: tuple[str, ...], time_s: Floats, position: Floats) -> None:
    missing = np.isnan(position).sum(axis=2)
    part = np.argwhere((missing > 0) & (missing < 3))
    if len(part):
        row, marker = part[0]
        raise DataError(
            f'markers: "{names[marker]}" at {time_s[row]:g} s is {position[row, marker].tolist()}: a marker has all '
            f"three coordinates or none ({len(part)} such places). Set all three to NaN where it was not seen."
        )
