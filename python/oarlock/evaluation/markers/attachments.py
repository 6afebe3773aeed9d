"""`Attachment`: the frame and the position in this frame at which a marker sits; reading and writing of both."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from oarlock.evaluation.markers.trajectories import Markers
from oarlock.model.chain_geometry import posture
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable, write_toml

if TYPE_CHECKING:
    from oarlock._core import Model

MARKER_STD_M: Final = 1e-3
"""Default standard deviation of a marker on a rigid body, m; use a larger one on skin."""


@dataclass(frozen=True, eq=False)
class Attachment:
    """One marker on a model.

    Args:
        marker: its name.
        frame: name of the model's frame that carries it.
        point_m: (3,) its position in the frame's axes, m.
        std_m: standard deviation of this position, from skin motion and cameras together, m; it determines the weight.

    Raises:
        DataError: a point that is not finite, or a standard deviation that is not positive.
    """

    marker: str
    frame: str
    point_m: Floats
    std_m: float = MARKER_STD_M

    def __post_init__(self) -> None:
        point = real_array(self.point_m, (3,), f'marker "{self.marker}", point_m')
        if not np.isfinite(point).all():
            raise DataError(
                f'marker "{self.marker}": point_m is {point.tolist()}; expected three numbers in m'
            )
        if not (self.std_m > 0.0 and np.isfinite(self.std_m)):
            raise DataError(f'marker "{self.marker}": std_m is {self.std_m}; expected a positive length in m')
        object.__setattr__(self, "point_m", point)


GivenAttachments: TypeAlias = Sequence[Attachment] | Mapping[str, str]


def attachments_of(given: GivenAttachments) -> tuple[Attachment, ...]:
    """Attachments unchanged, or made from a mapping `{marker: frame}` of markers at the origins of frames.

    Raises:
        DataError: a marker occurs twice, or there is none.
    """
    if isinstance(given, Mapping):
        found = tuple(Attachment(marker, frame, np.zeros(3)) for marker, frame in given.items())
    else:
        found = tuple(given)
    names = [a.marker for a in found]
    for name in names:
        if names.count(name) > 1:
            raise DataError(f'attachments: the marker "{name}" is attached {names.count(name)} times')
    if not found:
        raise DataError("attachments: no marker is attached to anything")
    return found


def check_frames(model: Model, frames: Iterable[str], where: str) -> None:
    """Refuse a frame that the model does not have.

    Raises:
        DataError: the model has no such frame; names the most similar one.
    """
    for frame in frames:
        if frame not in model.frame_names:
            raise DataError(
                f'{where}: "{model.name}" has no frame "{frame}". {did_you_mean(frame, model.frame_names)}'
            )


def load_attachments(path: str | PathLike[str]) -> tuple[Attachment, ...]:
    """Read attachments: `format = 1`, and for each marker a table `[[marker]]` with name, frame, point (m), std_m.

    Raises:
        DataError: a mistake in the file, with line and key.
    """
    table = TomlTable.read(place_of(path))
    table.check_keys(("format", "marker"))
    table.check_format(1)
    found = []
    for entry in table.tables("marker"):
        entry.check_keys(("name", "frame", "point", "std_m"))
        point = entry.values.get("point", [0.0, 0.0, 0.0])
        try:
            std_m = entry.number("std_m", MARKER_STD_M)
            found.append(Attachment(entry.string("name"), entry.string("frame"), _three(entry, point), std_m))
        except DataError as error:
            raise (
                error if str(error).startswith(str(path)) else DataError(f"{entry.where()}: {error}")
            ) from None
    return attachments_of(found)


def save_attachments(attachments: GivenAttachments, path: str | PathLike[str]) -> None:
    """Write a file that `load_attachments` reads.

    Raises:
        DataError: the file cannot be written.
    """
    entries = [
        {"name": a.marker, "frame": a.frame, "point": a.point_m.tolist(), "std_m": float(a.std_m)}
        for a in attachments_of(attachments)
    ]
    write_toml(Path(path), {"format": 1, "marker": entries})


def attach_markers(
    model: Model,
    static: Markers,
    frames: Mapping[str, str],
    q: Mapping[str, float] | ArrayLike | None = None,
    *,
    root_from_markers: ArrayLike | None = None,
    std_m: float = MARKER_STD_M,
) -> tuple[Attachment, ...]:
    """Determine marker positions on the model from a static trial in a known posture.

    Args:
        model: with the person's lengths.
        static: the trial; the mean position of each marker is used.
        frames: marker -> frame that carries it.
        q: the posture in the trial: values by name (others 0), an array (n_coordinates,), or None for all 0; rad and m.
        root_from_markers: (4, 4) pose of the measuring system in root axes; None if its axes are the root's.
        std_m: of every marker, m.

    Raises:
        DataError: a marker is never visible in the trial, or the model lacks a frame.
    """
    check_frames(model, frames.values(), "attach_markers")
    placed = static if root_from_markers is None else static.moved(root_from_markers)
    poses = model.forward_kinematics(posture(model, q))
    found = []
    for marker, frame in frames.items():
        place = placed[marker]
        if not np.isfinite(place).any():
            raise DataError(f'attach_markers: "{marker}" is never seen in the static trial')
        pose = poses[model.frame_names.index(frame)]
        found.append(
            Attachment(marker, frame, pose[:3, :3].T @ (np.nanmean(place, axis=0) - pose[:3, 3]), std_m)
        )
    return tuple(found)


def _three(entry: TomlTable, point: object) -> Floats:
    numbers = isinstance(point, list) and all(
        isinstance(v, int | float) and not isinstance(v, bool) for v in point
    )
    if not numbers or len(point) != 3:  # type: ignore[arg-type]
        raise DataError(f"{entry.where('point')}: is {point!r}; expected [x, y, z] in m, in the frame's axes")
    return np.array(point, dtype=np.float64)
