"""`oarlock report`: a track as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import UsageError, print_json, say, verb

if TYPE_CHECKING:
    from oarlock import Evaluation, Track


CLASSES = (
    "sculling_men",
    "sculling_women",
    "sculling_light_women",
    "sculling",
    "sweep_men",
    "sweep_women",
    "ergometer",
)
"""Those of `oarlock.rowing.TARGET_CLASSES`, which help would be slow to import."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "report",
        epilog=example(
            "oarlock report out",
            "oarlock report out --truth trial/truth",
            "oarlock report after --compare before",
            "oarlock report out --to a.html",
        ),
    )(report)


@verb
def report(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FOLDER", help="Draw the truth beside the estimate.")
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare",
            metavar="TRACK2",
            help="Of rowers: another piece or athlete, or before and after, beside this one.",
        ),
    ] = None,
    targets: Annotated[
        str | None,
        typer.Option(
            "--targets",
            metavar="NAME|FILE",
            help="Of rowers: published ranges to draw, of a boat class, or of a file of your own. Classes: "
            f"{', '.join(CLASSES)}.",
        ),
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--to", metavar="FILE", help="The file to write; else TRACK/report.html.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Write report.html: one file, offline, with what was found, curves and sensor health.

    Where the model is of a rower it begins with the strokes: a summary in words, a player, strokes.csv beside the page,
    curves, paths of the hands, left and right. What each number means, its unit, its sign and who defined it stands in
    the page itself, under "What each number means", and in docs/report.md.
    """
    from oarlock import load_track

    known = load_track(truth_folder(truth)) if truth is not None else None
    other = load_track(compare) if compare is not None else None
    track = load_track(out)
    names = (out.name, compare.name if compare is not None else "")
    written = write_any_report(
        track, to or out / "report.html", truth=known, other=other, names=names, targets=targets
    )
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
) -> list[Path]:
    """Writes the report of a body of any kind; of a rower with strokes. The files written, the report first."""
    from oarlock.report import write_report
    from oarlock.rowing.report.write import is_of_rower, write_rowing_report

    if is_of_rower(track):
        return write_rowing_report(track, path, evaluation, truth, other=other, names=names, targets=targets)
    for flag, asked in (("--compare", other), ("--targets", targets)):
        if asked is not None:
            raise UsageError(
                f"{flag} is for tracks of rowers; this one has joints {', '.join(track.joint_names[:6])}"
            )
    return [write_report(track, path, evaluation, truth)]
