"""`oarlock report`: writes a track as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.options import Json, Replace, example
from oarlock.cli.terminal import UsageError, free_file, print_json, progress, say, verb

if TYPE_CHECKING:
    from oarlock import Evaluation, Track
    from oarlock.rowing import Activity, StrokeTable


CLASSES = (
    "sculling_men",
    "sculling_women",
    "sculling_light_women",
    "sculling",
    "sweep_men",
    "sweep_women",
    "ergometer",
)
"""Those of `oarlock.rowing.TARGET_CLASSES`. Copied, because the import would slow down the help text."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "report",
        epilog=example(
            "oarlock report out",
            "oarlock report out --truth trial/truth",
            "oarlock report after --compare before",
            "oarlock report out --with rp3.csv",
            "oarlock report out --to a.html",
        ),
    )(report)


@verb
def report(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: Annotated[
        Path | None,
        typer.Option("--truth", metavar="FOLDER", help="Draw the ground truth with the estimate."),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare",
            metavar="TRACK2",
            help="Rowing: compare with the track of another piece or athlete.",
        ),
    ] = None,
    targets: Annotated[
        str | None,
        typer.Option(
            "--targets",
            metavar="NAME|FILE",
            help="Rowing: draw published ranges of a boat class or of your own file. Classes: "
            f"{', '.join(CLASSES)}.",
        ),
    ] = None,
    beside: Annotated[
        Path | None,
        typer.Option(
            "--with",
            metavar="FILE",
            help="Rowing: add pace, heart rate and force of a device's export of the same piece.",
        ),
    ] = None,
    offset: Annotated[
        float | None,
        typer.Option(
            "--offset",
            metavar="SECONDS",
            help="With --with: what to add to the export's times, if intervals between strokes cannot tell.",
        ),
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--to", metavar="FILE", help="The file to write; else TRACK/report.html.")
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Write report.html: one file that works offline, with a summary, curves and sensor health.

    The report of a rower begins with the strokes: a summary, a player, curves, paths of the hands, left and right. It
    writes strokes.csv beside the page. The section "What each number means" and docs/report.md define each number
    with its unit, sign and source.
    """
    from oarlock import load_track
    from oarlock.rowing import load_export
    from oarlock.storage.added_files import added_files

    if offset is not None and beside is None:
        raise UsageError("--offset needs --with FILE: it is the offset of that export's clock")
    page = to or out / "report.html"
    page = page / "report.html" if page.is_dir() else page
    free_file(page, force)
    known = load_track(truth_folder(truth)) if truth is not None else None
    other = load_track(compare) if compare is not None else None
    track = load_track(out)
    export = None if beside is None else (load_export(beside), offset)
    names = (out.name, compare.name if compare is not None else "")
    with added_files(page.parent, force) as stage:
        staged = write_any_report(
            track, stage / page.name, truth=known, other=other, names=names, targets=targets, export=export
        )
    written = [page.with_name(file.name) for file in staged]
    if json_output:
        print_json({"report": written[0], "beside": written[1:]})
        return
    say(f"Wrote {' and '.join(str(path) for path in written)}")


def write_any_report(
    track: Track,
    path: Path,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    other: Track | None = None,
    names: tuple[str, str] = ("", ""),
    targets: str | None = None,
    export: tuple[StrokeTable | Activity, float | None] | None = None,
) -> list[Path]:
    """Write the report of any model; add strokes for rowers. Return the written files, the report first."""
    from oarlock.rowing.report.write import is_of_rower, write_rowing_report

    if is_of_rower(track):
        with progress("writing the report"):
            return write_rowing_report(
                track, path, evaluation, truth, other=other, names=names, targets=targets, export=export
            )
    for flag, asked in (("--compare", other), ("--targets", targets), ("--with", export)):
        if asked is not None:
            raise UsageError(
                f"{flag} needs the track of a rower; this one has the joints {', '.join(track.joint_names[:6])}"
            )
    from oarlock.movement.report import write_movement_report

    with progress("writing the report"):
        return write_movement_report(track, path, evaluation, truth)
