"""`oarlock live track`: the estimates of a live session again, as a track that all other verbs read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from oarlock.cli.options import Force, Json, OutFolder, example
from oarlock.cli.tables import write_contradiction, write_summary
from oarlock.cli.terminal import output_folder, print_json, progress, say, steps, verb
from oarlock.cli.track_folder import TRACK, document, write_folder


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "track",
        epilog=example(
            "oarlock live track today --out today/track",
            "oarlock track today/recording --model sculler --smooth --out best",
        ),
    )(track)


@verb
def track(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="A folder that `oarlock live run` wrote.")],
    out: OutFolder,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the tables as CSV.")] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Write a session's estimates as a track, exactly as they were shown live: bit for bit.

    Other settings, smoothing or the best angles: use `oarlock track` with the recording in the same folder.
    """
    import oarlock
    from oarlock.live.folder import LiveFolder
    from oarlock.live.live_track import live_track

    place = LiveFolder.load(folder)
    name = place.rig().model
    with output_folder(out, TRACK, force) as stage:
        with progress("repeating the session") as told:
            result = live_track(place, oarlock.load_model(name), told)
        write_folder(result, stage, csv)
    if json_output:
        print_json(document(result, out))
        return
    write_contradiction(result.notes)
    say(f"Live track of {folder}", style="bold")
    write_summary(result)
    say(f"\nWrote {out}: track, sensors, beliefs (.parquet), model.toml, run.toml, report.html")
    steps(
        f"open {out / 'report.html'}",
        f"oarlock track {folder / 'recording'} --model {name} --smooth --out BEST",
    )
