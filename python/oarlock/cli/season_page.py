"""`oarlock season page`: a season as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from oarlock.cli.options import Json, Replace, example
from oarlock.cli.season_options import SeasonAt, opened
from oarlock.cli.terminal import free_file, print_json, say, verb


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "page",
        epilog=example(
            "oarlock season page season --out season.html",
            "oarlock season page season --out pages --athlete K7QMVA --metric catch_angle --metric rhythm",
        ),
    )(page)


@verb
def page(
    at: SeasonAt,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="File to write, or a folder for season.html.")
    ],
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="Only this athlete.")
    ] = None,
    metric: Annotated[
        list[str] | None,
        typer.Option("--metric", metavar="NAME", help="Number of a stroke, such as catch_angle. Repeatable."),
    ] = None,
    comparable: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="Compare this class of runs.")
    ] = None,
    scope: Annotated[
        str | None,
        typer.Option(
            "--scope", metavar="NAME", help="Only athletes who consent to: coaching, research, sharing."
        ),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Write a season as a page that works offline: sessions, changes, trends, sensor health."""
    from oarlock.season import Selection, write_season_page

    target = out / "season.html" if out.is_dir() or not out.suffix else out
    free_file(target, force)
    written = write_season_page(opened(at), target, metric, Selection(athlete, scope=scope), comparable)
    if json_output:
        return print_json({"file": str(written), "bytes": written.stat().st_size})
    say(f"Wrote {written} ({written.stat().st_size / 1e6:.1f} MB)")
