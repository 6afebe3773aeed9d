"""`oarlock export`: writes a track for other software."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from oarlock.cli.options import Force, Json, example, names
from oarlock.cli.terminal import UsageError, heading, output_folder, print_json, say, steps, table, verb
from oarlock.formats.export.export import FORMATS, KIND, SUMMARY, files_of

if TYPE_CHECKING:
    from oarlock import Export

AXES = ("y-up", "root")
MISSING = ("nan", "drop")

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


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "export",
        epilog=example(
            "oarlock export out --out exported",
            "oarlock export out --out exported --format osim,mot,trc",
            "oarlock export out --out exported --format mot --radians --missing drop",
            "oarlock export out --out blender --format bvh,glb",
            "oarlock export out --out exported --format csv --json | jq .files",
        )
        + "\n\n"
        + _ABOUT,
    )(export)


@verb
def export(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    to: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder to write.")],
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            "-f",
            metavar="FORMAT,...",
            help=f"Some of {', '.join(FORMATS)}; all if left out. Repeatable.",
        ),
    ] = None,
    degrees: Annotated[
        bool, typer.Option("--degrees/--radians", help="Angles in .mot and .sto; their header says which.")
    ] = True,
    axes: Annotated[
        str,
        typer.Option("--axes", metavar="y-up|root", help="Ground of .osim, .trc, .bvh and .c3d, see below."),
    ] = "y-up",
    missing: Annotated[
        str,
        typer.Option("--missing", metavar="nan|drop", help="Rows of .mot and .sto that lack a reading."),
    ] = "nan",
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Write a track for other software: tables, files for OpenSim, and animations (BVH, glTF, C3D)."""
    import oarlock

    chosen = _chosen(formats)
    _check("--axes", axes, AXES)
    _check("--missing", missing, MISSING)
    track = oarlock.load_track(out)
    with output_folder(to, KIND, force) as stage:
        written = oarlock.export(
            track,
            stage,
            chosen,
            degrees=degrees,
            axes=cast(Literal["y-up", "root"], axes),
            missing=cast(Literal["nan", "drop"], missing),
        )
    written = replace(written, folder=to)
    if json_output:
        print_json(written.to_dict())
        return
    _write(written)


def _chosen(formats: list[str] | None) -> tuple[str, ...] | None:
    if formats is None:
        return None
    chosen = tuple(name for text in formats for name in names(text))
    for name in chosen:
        _check("--format", name, FORMATS)
    if not chosen:
        raise UsageError(f"--format names none; choose some of {', '.join(FORMATS)}")
    return chosen


def _check(flag: str, given: str, known: tuple[str, ...]) -> None:
    if given not in known:
        raise UsageError(f"{flag} {given}: choose from {', '.join(known)}")


def _write(written: Export) -> None:
    table(["file", "contents"], [*written.files.items(), (SUMMARY, "this table, settings, notes, names")])
    if written.notes:
        heading("Notes")
        for note in written.notes:
            say(note, indent=2)
    say(f"\nWrote {written.folder}")
    if {"model.osim", "coordinates.mot"} <= set(written.files):
        steps("In OpenSim: File > Open Model: model.osim, then File > Load Motion: coordinates.mot")
