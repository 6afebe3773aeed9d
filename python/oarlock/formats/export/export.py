"""`export`: writes a track as tables, for OpenSim, and as movement of a skeleton (BVH, glTF, C3D)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

from oarlock._core import __version__
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock.tracking.track import Track

Axes = Literal["y-up", "root"]
Missing = Literal["nan", "drop"]

_FILES: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "csv": {
            "coordinates.csv": "all estimates, one column each, unit in its name; SI, rad, root axes; empty: no number",
            "angles.csv": "joint angles and their standard deviations, deg; lengths in cm; empty: no number",
            "frames.csv": "positions of all frames, m, root axes; empty: no number",
        },
        "parquet": {
            "coordinates.parquet": "the same as coordinates.csv; units are also metadata; NaN: no number",
            "angles.parquet": "the same as angles.csv",
            "frames.parquet": "the same as frames.csv",
        },
        "mot": {"coordinates.mot": "coordinates of model.osim over time, {angle} and m; nan: no reading"},
        "sto": {
            "velocities.sto": "their time derivatives, {angle} and m per second",
            "std.sto": "their standard deviations, {angle} and m",
        },
        "trc": {"frames.trc": "positions of all frames as markers, mm, {ground}; NaN: no position"},
        "osim": {"model.osim": "one body and one marker for each frame, {ground}; masses are placeholders"},
        "bvh": {"animation.bvh": "skeleton and its movement, cm, deg, {ground}"},
        "glb": {"animation.glb": "skeleton and its movement, glTF 2.0 binary, m, Y up"},
        "c3d": {"frames.c3d": "positions of all frames but the root as points, mm, {ground}"},
        "opensense": {"orientations.sto": "orientations of bodies with units for OpenSense, {ground}"},
    }
)
FORMATS: Final = tuple(_FILES)
OPENSIM: Final = ("mot", "sto", "trc", "osim")
ANIMATIONS: Final = ("bvh", "glb", "c3d", "opensense")
SUMMARY: Final = "export.toml"
KIND: Final = "export"


def files_of(
    angle: str = "deg (or rad)", ground: str = "OpenSim's ground, Y up"
) -> dict[str, dict[str, str]]:
    """The contents of each file of each format, by the file's name."""
    return {
        name: {file: text.format(angle=angle, ground=ground) for file, text in files.items()}
        for name, files in _FILES.items()
    }


@dataclass(frozen=True)
class Export:
    """Result of `export`.

    Args:
        folder: what was written.
        files: contents of each file by name.
        notes: on missing data.
        body_names: OpenSim's names of frames.
    """

    folder: Path
    files: Mapping[str, str]
    notes: tuple[str, ...]
    body_names: Mapping[str, str]

    def to_dict(self) -> dict[str, Any]:
        """The contents of export.toml."""
        return {
            "folder": str(self.folder),
            "files": dict(self.files),
            "notes": list(self.notes),
            "body_names": dict(self.body_names),
        }


def export(
    track: Track,
    folder: str | PathLike[str],
    formats: Sequence[str] | None = None,
    *,
    degrees: bool = True,
    axes: Axes = "y-up",
    missing: Missing = "nan",
    force: bool = False,
) -> Export:
    """Write a track for other software (docs/export.md), with export.toml about each file.

    Args:
        track: without its model only `csv` and `parquet` without frames can be written.
        folder: created; an earlier export in it is replaced.
        formats: `csv`, `parquet`, `mot`, `sto`, `trc`, `osim`, `bvh`, `glb`, `c3d`, `opensense`; None: all possible.
        degrees: angles of .mot and .sto in deg, else rad.
        axes: of all but tables: `y-up`, rotated by the smallest angle that makes `up` Y, or `root`.
        missing: rows of .mot and .sto without a reading: `nan` or `drop`.
        force: replace files that are not Oarlock's, too.

    Raises:
        DataError: an unknown format, no samples, no model, or a folder that cannot be written.
    """
    chosen = _checked(track, FORMATS if formats is None else formats, axes, missing)
    with replaced_folder(folder, KIND, force) as stage:
        written = _written(track, stage, chosen, degrees, axes, missing, formats is None)
    return replace(written, folder=Path(folder))


def _written(
    track: Track,
    place: Path,
    formats: Sequence[str],
    degrees: bool,
    axes: Axes,
    missing: Missing,
    skip: bool,
) -> Export:
    from oarlock.formats.export.animation import write_animations
    from oarlock.formats.export.notes import empty_notes, reading_notes
    from oarlock.formats.export.write_opensim import write_opensim
    from oarlock.storage.toml import write_toml

    done, left_out = _write_tables(track, place, formats, skip)
    notes, names = (*reading_notes(track), *empty_notes(track, done), *left_out), {}
    if set(formats) & {*OPENSIM, *ANIMATIONS}:
        opensim = write_opensim(track, place, formats, degrees, axes, missing)
        animated, remarks = write_animations(track, place, formats, axes, opensim.body_names, skip)
        done += [*opensim.files, *animated]
        notes, names = (*notes, *opensim.notes, *remarks), dict(opensim.body_names)
    texts = files_of("deg" if degrees else "rad", "ground with Y up" if axes == "y-up" else "root axes")
    held = {file: text for name in formats for file, text in texts[name].items() if file in done}
    found = Export(place, held, notes, names)
    about = {
        "format": 1,
        "oarlock": __version__,
        "model": "" if track.model is None else track.model.name,
        "settings": {"formats": list(formats), "degrees": degrees, "axes": axes, "missing": missing},
    }
    write_toml(place / SUMMARY, about | {k: v for k, v in found.to_dict().items() if k != "folder"})
    return found


def _write_tables(
    track: Track, place: Path, formats: Sequence[str], skip: bool
) -> tuple[list[str], list[str]]:
    from oarlock.formats.export.frames import frame_places
    from oarlock.formats.export.tables import (
        angle_columns,
        frame_columns,
        told_columns,
        write_csv,
        write_parquet,
    )

    if not {"csv", "parquet"} & set(formats):
        return [], []
    columns = told_columns(track)
    tables = {"coordinates": columns, "angles": angle_columns(columns)}
    if track.model is not None:
        tables["frames"] = frame_columns(frame_places(track))
    done, notes = [], []
    for name, columns in tables.items():
        if "csv" in formats:
            write_csv(columns, place / f"{name}.csv")
            done.append(f"{name}.csv")
        if "parquet" in formats:
            about = {"model": "" if track.model is None else track.model.name, "axes": "root"}
            try:
                write_parquet(columns, place / f"{name}.parquet", {**about, "notes": track.notes})
            except DataError as error:
                if not skip:
                    raise
                notes = [str(error).replace("export: ", "tables are not written as Parquet: ", 1)]
            else:
                done.append(f"{name}.parquet")
    return done, notes


def _checked(track: Track, formats: Sequence[str], axes: str, missing: str) -> tuple[str, ...]:
    chosen = (formats,) if isinstance(formats, str) else tuple(formats)
    for given, known in (
        (chosen, tuple(FORMATS)),
        ((axes,), ("y-up", "root")),
        ((missing,), ("nan", "drop")),
    ):
        for name in given:
            if name not in known:
                raise DataError(f"export: {name!r} is not known. {did_you_mean(str(name), known)}")
    if not chosen:
        raise DataError(f"export: no format is given; choose some of {', '.join(FORMATS)}")
    if not len(track.time_s):
        raise DataError("export: the track has no samples")
    needing = [name for name in chosen if name in (*OPENSIM, *ANIMATIONS)]
    if track.model is None and needing:
        raise DataError(
            f"export: {', '.join(needing)} need the track's model, which was not found when it was loaded; restore its "
            "model.toml, or choose csv and parquet"
        )
    return tuple(dict.fromkeys(chosen))
