"""`oarlock season export` and `oarlock season erase`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.season_options import CutGps, SeasonAt, Tombstones, opened
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
    from oarlock.season.traces import Trace


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
            "oarlock season erase season --again --yes",
        ),
    )(erase)


@verb
def export(
    at: SeasonAt,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder outside the season; a new one.")],
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
                    told=lambda part, number=number: share((number + part) / len(chosen)),  # type: ignore[misc]
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
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="Who is erased.")
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Erase again all who came back with a restored backup.")
    ] = False,
    names: Annotated[
        Path | None,
        typer.Option(
            "--names", metavar="FILE", help="File of names: the person's name is searched and removed."
        ),
    ] = None,
    tombstones: Tombstones = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be removed.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Remove it; it cannot be undone.")] = False,
    json_output: Json = False,
) -> None:
    """Remove all data of an athlete for good, then search every file of the season for traces.

    A hash of the pseudonym, the date and counts stay. With them, the athlete is also erased from a restored backup.
    """
    from oarlock.season.athletes import NamesFile
    from oarlock.season.erase import erase as erased
    from oarlock.season.erase_again import came_back, erase_again

    if (athlete is None) == (not again):
        raise UsageError("give --athlete PSEUDONYM, or --again after a backup was restored")
    if dry_run == yes:
        raise UsageError("give --dry-run to see what would be removed, or --yes to remove it for good")
    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file")
    season = opened(at)
    known = None if names is None else NamesFile.read(names)
    persons = [] if known is None else [name for name, of in known.pseudonyms.items() if of == athlete]
    with progress("searching") as share:
        if athlete is not None:
            found = [
                erased(season, athlete, names=persons, tombstones=tombstones, dry_run=dry_run, told=share)
            ]
        elif dry_run:
            found = [
                erased(season, name, dry_run=True, told=share) for name in came_back(season, tombstones, True)
            ]
        else:
            found = erase_again(season, tombstones, True, share)
    proven = all(one.is_proven for one in found)
    if known is not None and athlete is not None and not dry_run and persons:
        known.without(athlete).write()
    if json_output:
        print_json({"erased": found, "is_proven": proven})
    else:
        _say_erased(found, at, names)
        if persons and not dry_run:
            say(f"Removed the name from {names}")
        elif names is not None and not persons and athlete is not None:
            say(f"{names} has no name for {athlete}; only the pseudonym and recordings were searched")
    if not dry_run and not proven:
        raise typer.Exit(EXIT_DATA)


def _say_erased(found: Sequence[Erasure], at: str, names: Path | None) -> None:
    if not found:
        say("Nobody who was erased is in this season.")
    for one in found:
        told = "" if names is None else f" --names {names}"
        again = f"oarlock season erase {at} --athlete {one.athlete}{told} --yes"
        heading(f"{'Would erase' if one.is_dry_run else 'Erased'} {one.athlete}")
        pairs([(words, count) for words, count in one.removed.items()])
        _show_counted("Found by the search and removed", _traces(one.cleared))
        _show_counted("Also found in" if one.is_dry_run else "Not erased", _traces(one.left))
        _show_counted("Copies that could not be removed", one.elsewhere)
        if one.is_proven:
            say(f"Searched {one.files} files: nothing of {one.athlete} is left.")
        elif one.is_dry_run:
            steps(again)
        else:
            say("The erasure is not proven: remove what is listed above, then erase again.")
            steps(f"oarlock season check {at}", again)


def _traces(traces: Sequence[Trace]) -> list[str]:
    return [f"{one.file}: {one.where}: {one.what}" for one in traces]


def _show_counted(title: str, lines: Sequence[str]) -> None:
    show_list(f"{title}: {len(lines)}", lines)
