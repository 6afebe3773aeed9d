"""`oarlock report`: a track as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import print_json, say, verb


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "report",
        short_help="Write a track's report.html.",
        epilog=example(
            "oarlock report out", "oarlock report out --truth trial/truth", "oarlock report out --to a.html"
        ),
    )(report)


@verb
def report(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FOLDER", help="Draw the truth beside the estimate.")
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--to", metavar="FILE", help="The file to write; else TRACK/report.html.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Write report.html: one file, offline, with table, curves and sensor health."""
    from oarlock import load_track
    from oarlock.report import write_report

    known = load_track(truth_folder(truth)) if truth is not None else None
    written = write_report(load_track(out), to or out / "report.html", truth=known)
    if json_output:
        print_json({"report": written})
        return
    say(f"Wrote {written}")
