"""`oarlock season export` and `oarlock season erase`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.season_options import CutGps, SeasonAt, opened
from oarlock.cli.season_tables import show_list
from oarlock.cli.terminal import (
    EXIT_DATA,
    UsageError,
    continuing_verb,
    heading,
    pairs,
    print_json,
    progress,
    say,
    steps,
    table,
    verb,
)
from oarlock.storage.regular_file import shown_bytes

if TYPE_CHECKING:
    from oarlock.season.erase import Erasure
    from oarlock.season.exports import Exported


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    group.command(
        "export",
        epilog=example(
            "oarlock season export season --athlete K7QMVA --out mine",
            "oarlock season export season --scope sharing --out shared --cut-gps-m 200",
        ),
    )(export)
    group.command(
        "erase",
        epilog=example(
            "oarlock season erase season --athlete K7QMVA --dry-run",
            "oarlock season erase season --athlete K7QMVA --names ~/names.toml --yes",
        ),
    )(erase)


@verb
def export(
    at: SeasonAt,
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder outside the season; a new one.")
    ],
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="Everything of this athlete.")
    ] = None,
    scope: Annotated[
        str | None,
        typer.Option(
            "--scope", metavar="SCOPE", help="Only who consents to this: coaching, research or sharing."
        ),
    ] = None,
    cut_gps_m: CutGps = None,
    json_output: Json = False,
) -> None:
    """Write all data of an athlete, or of all who consent to a use, into a folder: as CSV and as stored.

    The season remembers the folder, so that `erase` also removes it.
    """
    from oarlock.season.exports import export_athlete, may_share

    if athlete is None and scope is None:
        raise UsageError("give --athlete PSEUDONYM, or --scope for all who consent to a use")
    season = opened(at)
    willing, others = may_share(season, scope) if scope is not None else ([str(athlete)], [])
    if athlete is not None and athlete in others:
        raise UsageError(
            f"{athlete} has not consented to {scope}, or has withdrawn the consent; nothing was exported"
        )
    chosen = [athlete] if athlete is not None else willing
    done: list[Exported] = []
    with progress("exporting") as share:
        for number, one in enumerate(chosen):
            done.append(
                export_athlete(
                    season,
                    one,
                    out,
                    cut_gps_m=cut_gps_m,
                    progress=lambda part, number=number: share((number + part) / len(chosen)),  # type: ignore[misc]
                )
            )
    left_out = [] if athlete is not None else others
    if json_output:
        return print_json({"exported": done, "left_out": left_out})
    table(
        ("athlete", "folder", "files", "size"),
        [(one.athlete, one.folder, one.files, shown_bytes(one.bytes)) for one in done],
    )
    if left_out:
        say(f"Left out without consent to {scope}: {', '.join(left_out)}")


@continuing_verb
def erase(
    at: SeasonAt,
    athlete: Annotated[str, typer.Option("--athlete", metavar="PSEUDONYM", help="Who is erased.")],
    names: Annotated[
        Path | None,
        typer.Option("--names", metavar="FILE", help="File of names: the person's name is removed from it."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be removed.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Remove it; it cannot be undone.")] = False,
    json_output: Json = False,
) -> None:
    """Remove the folder of an athlete for good, and its former versions on S3; then list what is left.

    Backups, and texts of other athletes, are not searched.
    """
    from oarlock.season.athletes import NamesFile
    from oarlock.season.erase import erase as erased

    if dry_run == yes:
        raise UsageError("give --dry-run to see what would be removed, or --yes to remove it for good")
    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file")
    season = opened(at)
    known = None if names is None else NamesFile.read(names)
    is_named = known is not None and athlete in known.pseudonyms.values()
    found = erased(season, athlete, dry_run=dry_run)
    if known is not None and is_named and not dry_run:
        known.without(athlete).write()
    if json_output:
        print_json({"erased": found, "is_proven": found.is_proven})
    else:
        _say_erased(found, at, names)
        if is_named and not dry_run:
            say(f"Removed the name from {names}")
        elif names is not None and not is_named:
            say(f"{names} has no name for {athlete}")
    if not dry_run and not found.is_proven:
        raise typer.Exit(EXIT_DATA)


def _say_erased(one: Erasure, at: str, names: Path | None) -> None:
    option = "" if names is None else f" --names {names}"
    again = f"oarlock season erase {at} --athlete {one.athlete}{option} --yes"
    heading(f"{'Would erase' if one.is_dry_run else 'Erased'} {one.athlete}")
    pairs([(words, count) for words, count in one.removed.items()])
    show_list(f"Not erased: {len(one.left)}", one.left)
    show_list(f"Copies that could not be removed: {len(one.elsewhere)}", one.elsewhere)
    if one.is_proven:
        say(f"Listed the folder again: nothing of {one.athlete} is left.")
    elif one.is_dry_run:
        steps(again)
    else:
        say("The erasure is not proven: remove what is listed above, then erase again.")
        steps(f"oarlock season check {at}", again)
