"""Writes the OpenSim files of an export."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from oarlock.evaluation.markers.texts import trc_text
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.formats.export.frames import frame_places, ground_from_root
from oarlock.formats.export.notes import left_out_notes, model_notes, pole_notes, reading_notes
from oarlock.formats.export.opensim_body import opensim_body
from oarlock.formats.export.opensim_motion import OpensimMotion, opensim_motion
from oarlock.formats.opensim_table import table_text
from oarlock.formats.osim import osim_text
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from oarlock.tracking.track import Track


@dataclass(frozen=True)
class Written:
    """Names of the files, notes on them, and the OpenSim name of each frame."""

    files: list[str]
    notes: tuple[str, ...]
    body_names: Mapping[str, str]


def write_opensim(
    track: Track, place: Path, formats: Sequence[str], degrees: bool, axes: str, missing: str
) -> Written:
    """Write the requested files of coordinates.mot, velocities.sto, std.sto, frames.trc and model.osim.

    Raises:
        DataError: `missing` is `drop` and no row has all its readings.
    """
    assert track.model is not None
    up = np.asarray(track.model.describe().world.up)
    turned = ground_from_root(up, axes == "y-up")
    body = opensim_body(track.model, turned)
    texts: dict[str, str] = {}
    notes = list(pole_notes(track))
    if "osim" in formats:
        texts["model.osim"] = osim_text(body.osim)
        notes += model_notes(track.model)
    if "trc" in formats:
        seen = frame_places(track)
        named = Markers(tuple(body.frames[name] for name in seen.names), seen.time_s, seen.position_m)
        moved = named.turned(turned[:3, :3])
        texts["frames.trc"] = trc_text(
            moved.names, moved.time_s, moved.position_m, place / "frames.trc", "mm"
        )
    if {"mot", "sto"} & set(formats):
        motion = opensim_motion(track, body.coordinates)
        kept = _kept(motion, missing)
        notes += _notes_on(kept)
        remarks = reading_notes(track)
        for table in _tables(motion, formats):
            notes += left_out_notes(table.file, table.what, motion.names, table.there.tolist())
            if table.there.any() or not motion.names:
                texts[table.file] = _text(table, motion, track.time_s, kept, degrees, remarks)
    for name, text in texts.items():
        write_file(place / name, text)
    return Written(list(texts), tuple(notes), body.frames)


@dataclass(frozen=True, eq=False)
class _OpenSimTable:
    file: str
    title: str
    what: str
    values: Floats

    @property
    def there(self) -> Bools:
        """Whether a column contains a number, (n,)."""
        return np.asarray(np.isfinite(self.values).any(axis=0))


def _tables(motion: OpensimMotion, formats: Sequence[str]) -> Iterator[_OpenSimTable]:
    if "mot" in formats:
        yield _OpenSimTable("coordinates.mot", "Coordinates", "value", motion.value)
    if "sto" in formats:
        yield _OpenSimTable("velocities.sto", "Speeds", "velocity", motion.rate)
        yield _OpenSimTable("std.sto", "Standard deviations", "standard deviation", motion.std)


def _text(
    table: _OpenSimTable,
    motion: OpensimMotion,
    time_s: Floats,
    kept: Bools,
    degrees: bool,
    remarks: Sequence[str],
) -> str:
    factor = np.where(motion.turns, 180.0 / np.pi, 1.0) if degrees else np.ones(len(motion.turns))
    values = (table.values * factor)[kept][:, table.there]
    labels = [name for name, there in zip(motion.names, table.there, strict=True) if there]
    return table_text(table.title, labels, time_s[kept], values, degrees, remarks)


def _kept(motion: OpensimMotion, missing: str) -> Bools:
    if missing == "nan":
        return np.ones(len(motion.value), dtype=bool)
    kept = np.isfinite(motion.value).all(axis=1)
    if not kept.any():
        raise DataError(
            'export: missing = "drop" would leave no row: in each one some coordinate has no reading. Choose "nan".'
        )
    return np.asarray(kept)


def _notes_on(kept: Bools) -> list[str]:
    left = int((~kept).sum())
    return (
        [f"{left} of {len(kept)} rows left out of .mot and .sto: a reading is missing there."] if left else []
    )
