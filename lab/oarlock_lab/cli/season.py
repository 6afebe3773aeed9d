"""`oarlock lab season`: a season made from a seed."""

from __future__ import annotations

from typing import Annotated

import typer

from oarlock.cli.options import Jobs, Json, example
from oarlock.cli.season_options import SeasonAt
from oarlock.cli.terminal import continuing_verb, print_json, progress, say, steps


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "season",
        epilog=example(
            "oarlock lab season season",
            "oarlock lab season season --recordings 10000 --athletes 60 --seed 1",
        ),
    )(season)


@continuing_verb
def season(
    at: SeasonAt,
    recordings: Annotated[
        int, typer.Option("--recordings", metavar="N", min=1, help="Recordings of 2 s, 300 strokes each.")
    ] = 1000,
    athletes: Annotated[int, typer.Option("--athletes", metavar="N", min=1, help="Athletes.")] = 60,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of all numbers.")] = 1,
    jobs: Jobs = None,
    json_output: Json = False,
) -> None:
    """Make a season of simulated numbers from a seed, to try questions and to measure speed.

    The same options make the same season. After Ctrl-C the same command continues.
    """
    from oarlock_lab.synthetic_season import Synthetic, make_synthetic

    what = Synthetic(recordings, athletes, seed)
    with progress("making recordings") as share:
        made = make_synthetic(at, what, jobs, share)
    if json_output:
        return print_json({"season": at, "id": made.id, "recordings": recordings, "athletes": athletes})
    say(f"Made {recordings} recordings of {athletes} athletes in {at}")
    steps(f"oarlock season list {at}", f"oarlock season questions {at}")
