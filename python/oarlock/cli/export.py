"""`oarlock export`: writes a track for other software."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from oarlock.cli.terminal import UsageError, heading, output_folder, say, steps, table
from oarlock.cli.verbs import NewFolder, command, names
from oarlock.formats.export.export import FORMATS, KIND, SUMMARY, files_of

if TYPE_CHECKING:
    from oarlock.formats.export.export import Export

_FILES = "\n".join(f"  {file:<21}{text}" for files in files_of().values() for file, text in files.items())
_ABOUT = f"""\b
Files:
{_FILES}
  {SUMMARY:<21}contents of each file, settings, notes, name of each frame in OpenSim

\b
Axes:
  Tables are in the axes of the model's root. OpenSim's ground has Y up: the root's axes, rotated by the
  smallest angle that makes the model's up Y. --axes root rotates nothing; gravity in
  model.osim then points along the model's down.

\b
Coordinates in OpenSim's files:
  hinge, slide     NAME, deg (or rad) or m
  ball, free       NAME_XYZ_x, NAME_XYZ_y, NAME_XYZ_z: body-fixed rotations about x, y, z of the joint,
                   R = Rx Ry Rz; continuous over time
  free             NAME_tx, NAME_ty, NAME_tz, m
  A joint that moves frames in several places has a coordinate for each, NAME_FRAME, which a
  CoordinateCouplerConstraint makes equal to NAME.

\b
Missing readings:
  A joint without any stream is written as 0. Single readings that are missing are nan, and so are the
  frames that they move; --missing drop leaves such rows out of .mot and .sto, as OpenSim's tools need.
"""


def _show(written: Export) -> None:
    table(["file", "contents"], [*written.files.items(), (SUMMARY, "this table, settings, notes, names")])
    if written.notes:
        heading("Notes")
        for note in written.notes:
            say(note, indent=2)
    say(f"\nWrote {written.folder}")
    if {"model.osim", "coordinates.mot"} <= set(written.files):
        steps("In OpenSim: File > Open Model: model.osim, then File > Load Motion: coordinates.mot")


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock export out --out exported",
        "oarlock export out --out exported --format osim,mot,trc",
        "oarlock export out --out exported --format mot --radians --missing drop",
        "oarlock export out --out blender --format bvh,glb",
        "oarlock export out --out exported --format csv --json | jq .files",
        show=_show,
        epilog=_ABOUT,
        metavars={"track": "TRACK", "format": "FORMAT,..."},
        opposites={"degrees": "radians"},
    )(export)


def export(
    track: Path,
    *,
    out: NewFolder,
    format: list[str] | None = None,
    degrees: bool = True,
    axes: Literal["y-up", "root"] = "y-up",
    missing: Literal["nan", "drop"] = "nan",
    force: bool = False,
) -> Export:
    """Write a track for other software: tables, files for OpenSim, and animations (BVH, glTF, C3D).

    Args:
        track: a folder that `oarlock track` wrote.
        out: folder to write.
        format: some of csv, parquet, mot, sto, trc, osim, bvh, glb, c3d, opensense; all if left out. Repeatable.
        degrees: angles in .mot and .sto; their header says which.
        axes: ground of .osim, .trc, .bvh and .c3d, see below.
        missing: rows of .mot and .sto that lack a reading.
        force: replace what is there.
    """
    import oarlock

    formats = None if format is None else tuple(name for text in format for name in names(text))
    if formats is not None and not (formats and set(formats) <= set(FORMATS)):
        wrong = next((name for name in formats if name not in FORMATS), "names none")
        raise UsageError(f"--format {wrong}: choose from {', '.join(FORMATS)}")
    estimate = oarlock.load_track(track)
    with output_folder(out, KIND, force) as stage:
        written = oarlock.export(estimate, stage, formats, degrees=degrees, axes=axes, missing=missing)
    return replace(written, folder=out)
