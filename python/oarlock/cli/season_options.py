"""Arguments and options that several verbs of `oarlock season` have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from oarlock.season import Season

SeasonAt = Annotated[
    str,
    typer.Argument(metavar="SEASON", help="Folder of the season, or its address, such as s3://club/season."),
]

CutGps = Annotated[
    float | None,
    typer.Option(
        "--cut-gps-m", metavar="M", help="Remove GPS positions this near to a track's start or end, m."
    ),
]


def opened(at: str) -> Season:
    """The season at an address."""
    from oarlock.season import open_season

    return open_season(at)
