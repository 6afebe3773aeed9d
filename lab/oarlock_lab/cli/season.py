"""`oarlock lab season`: a season made from a seed."""

from __future__ import annotations

from typing import Any

import typer

from oarlock.cli.terminal import progress
from oarlock.cli.verbs import command


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    command(
        group,
        "oarlock lab season season",
        "oarlock lab season season --recordings 10000 --athletes 60 --seed 1",
        continues=True,
        metavars={"at": "SEASON"},
        bounds={"recordings": (1, None), "athletes": (1, None), "seed": (0, None)},
    )(season)


def season(
    at: str, *, recordings: int = 1000, athletes: int = 60, seed: int = 1, jobs: int | None = None
) -> dict[str, Any]:
    """Make a season of simulated numbers from a seed, to try questions and to measure speed.

    The same options make the same season. After Ctrl-C the same command continues.

    Args:
        at: folder of the season, or its address, such as s3://club/season.
        recordings: recordings of 2 s, 300 strokes each.
        athletes: athletes.
        seed: seed of all numbers.
        jobs: parallel processes; default: all cores.
    """
    from oarlock_lab.synthetic_season import Synthetic, make_synthetic

    with progress("making recordings") as share:
        made = make_synthetic(at, Synthetic(recordings, athletes, seed), jobs, share)
    then = [f"oarlock season list {at}", f"oarlock season questions {at}"]
    return {"season": at, "id": made.id, "recordings": recordings, "athletes": athletes, "next": then}
