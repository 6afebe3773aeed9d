"""`oarlock season`: a squad's recordings and results in one place."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli import season_page, season_privacy, season_questions, season_run
from oarlock.cli.options import Json, example
from oarlock.cli.season_options import CutGps, SeasonAt, opened
from oarlock.cli.season_tables import MOST_SHOWN, say_more, show_list
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

if TYPE_CHECKING:
    from oarlock.season import Added

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="A squad's recordings, results and questions in one place.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    season_run.add_to(group)
    season_page.add_to(group)
    season_privacy.add_to(group)
    season_questions.add_to(group)
    app.add_typer(group, name="season")


@group.command(
    "init",
    epilog=example(
        "oarlock season init season --name 'Club 2026' --time-zone Europe/Berlin",
        "oarlock season init s3://club/season",
    ),
)
@verb
def init(
    at: SeasonAt,
    name: Annotated[
        str, typer.Option("--name", metavar="TEXT", help="Name of the season, for people.")
    ] = "season",
    time_zone: Annotated[
        str, typer.Option("--time-zone", metavar="NAME", help="Zone of local times, such as Europe/Berlin.")
    ] = "UTC",
    json_output: Json = False,
) -> None:
    """Begin a season in a folder, on a share, or in an object store.

    The file system or the store decides who may read it: set permissions there.
    """
    from oarlock.season import create_season

    season = create_season(at, name, time_zone)
    if json_output:
        return print_json({"season": at, "id": season.id, "name": name})
    say(f"Began the season {name} in {at}")
    steps(f"oarlock season athlete {at}", f"oarlock season add {at} RECORDING --athlete PSEUDONYM")


@group.command(
    "add",
    epilog=example(
        "oarlock season add season trial_1 trial_2 --athlete K7QMVA",
        "oarlock season add season recordings/* --names ~/names.toml",
        "oarlock season add season rp3.csv --athlete K7QMVA --date 2026-05-01",
    ),
)
@continuing_verb
def add(
    at: SeasonAt,
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING|FILE", help="Folders of recordings, or devices' exports."),
    ],
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="The athlete of all of them.")
    ] = None,
    names: Annotated[
        Path | None,
        typer.Option("--names", metavar="FILE", help="Pseudonyms by name; replaces names in session.toml."),
    ] = None,
    date: Annotated[
        str | None, typer.Option("--date", metavar="DATE", help="Day, such as 2026-05-01.")
    ] = None,
    boat: Annotated[str | None, typer.Option("--boat", metavar="TEXT", help="Boat.")] = None,
    seat: Annotated[str | None, typer.Option("--seat", metavar="TEXT", help="Seat in the boat.")] = None,
    rig: Annotated[str | None, typer.Option("--rig", metavar="TEXT", help="Rig or setting.")] = None,
    cut_gps_m: CutGps = None,
    json_output: Json = False,
) -> None:
    """Store recordings and devices' exports, each once; their names are hashes of their contents.

    Files that cannot be stored are listed with the reason; the others are stored.
    """
    from oarlock.season import Admission, NamesFile
    from oarlock.storage.errors import DataError

    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file; `oarlock season athlete --names` makes it")
    told = {"date": date, "boat": boat, "seat": seat, "rig": rig}
    session = {key: text for key, text in told.items() if text is not None}
    season = opened(at)
    mapping = None if names is None else NamesFile.read(names).pseudonyms
    admission = Admission(season, athlete, mapping, cut_gps_m)
    added: dict[str, Added] = {}
    refused: dict[str, str] = {}
    with progress("storing") as share:
        for done, source in enumerate(sources, start=1):
            try:
                added[str(source)] = admission.add(source, session)
            except DataError as error:
                refused[str(source)] = str(error)
            share(done / len(sources))
    if json_output:
        stored = {
            path: {"recording": one.entry.recording, "is_new": one.is_new} for path, one in added.items()
        }
        print_json({"stored": stored, "refused": refused})
    else:
        _say_added(added, refused)
    if refused:
        raise typer.Exit(EXIT_DATA)


def _say_added(added: dict[str, Added], refused: dict[str, str]) -> None:
    new = [one for one in added.values() if one.is_new]
    if new:
        table(
            ("recording", "athlete", "start (UTC)"),
            [(one.entry.recording, one.entry.athlete, _start(one)) for one in new[:MOST_SHOWN]],
        )
        say_more(len(new))
    before = len(added) - len(new)
    say(f"Stored {len(new)}" + (f"; {before} were there already" if before else ""))
    if refused:
        heading(f"Not stored: {len(refused)}")
        for words in refused.values():
            say(f"- {words}", indent=2)


def _start(one: Added) -> str:
    return "unknown" if one.entry.start is None else f"{one.entry.start:%Y-%m-%d %H:%M}"


@group.command("list", epilog=example("oarlock season list season", "oarlock season list season --json"))
@verb
def list_(at: SeasonAt, json_output: Json = False) -> None:
    """Show athletes, recordings, results and failures of a season."""
    from oarlock.season import season_summary

    found = season_summary(opened(at))
    if json_output:
        return print_json(found)
    say(f"{found.name} ({at})", style="bold")
    pairs([(words, value) for words, value in found.counts.items()])
    if found.athletes:
        heading("Athletes")
        table(
            tuple(found.athletes[0]),
            [tuple({**row, "hours": f"{row['hours']:.1f}"}.values()) for row in found.athletes],
        )
    failed = [f"{recording}: {fault}" for recording, fault in found.faults.items()]
    show_list("Failed", failed, rest=f"oarlock season questions {at} failed")


@group.command("check", epilog=example("oarlock season check season", "oarlock season check season --repair"))
@verb
def check(
    at: SeasonAt,
    repair: Annotated[
        bool, typer.Option("--repair", help="Remove damaged results and tables; `run` makes them again.")
    ] = False,
    json_output: Json = False,
) -> None:
    """Compare every file with its hash; list damaged and unfinished files."""
    from oarlock.season import upkeep

    season = opened(at)
    with progress("checking") as share:
        faults = upkeep.check(season, share)
    removed = upkeep.repair(season, faults) if repair else []
    if json_output:
        print_json({"findings": faults, "removed": removed})
    else:
        for one in faults:
            say(f"{one.what}: {one.name}: {one.words}")
        for name in removed:
            say(f"Removed {name}")
        say(f"{len(faults)} {'finding' if len(faults) == 1 else 'findings'}" if faults else "In order.")
        if not repair and any(one.is_repairable for one in faults):
            steps(f"oarlock season check {at} --repair")
    if any(one.is_damage for one in faults):
        raise typer.Exit(EXIT_DATA)


@group.command(
    "prune", epilog=example("oarlock season prune season --dry-run", "oarlock season prune season")
)
@verb
def prune(
    at: SeasonAt,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be removed.")] = False,
    json_output: Json = False,
) -> None:
    """Remove replaced results, data older than the retention time, and files of commands that were stopped."""
    import datetime

    from oarlock.season.upkeep import prune as pruned
    from oarlock.storage.regular_file import shown_bytes

    found = pruned(opened(at), datetime.datetime.now(datetime.UTC).date(), dry_run)
    if json_output:
        return print_json({"dry_run": dry_run, "removed": found})
    table(
        ("folder", "why", "size"),
        [(one.folder, one.why, shown_bytes(one.bytes)) for one in found[:MOST_SHOWN]],
    )
    say_more(len(found))
    total = shown_bytes(sum(one.bytes for one in found))
    say(f"{'Would remove' if dry_run else 'Removed'} {len(found)} folders, {total}")


@group.command(
    "athlete",
    epilog=example(
        "oarlock season athlete season --stature-m 1.86 --mass-kg 82",
        "oarlock season athlete season --name 'Anna Muster' --names ~/names.toml",
        "oarlock season athlete season --athlete K7QMVA --consent coaching --on 2026-03-01",
    ),
)
@verb
def athlete(
    at: SeasonAt,
    pseudonym: Annotated[
        str | None,
        typer.Option("--athlete", metavar="PSEUDONYM", help="Change this athlete; default: a new one."),
    ] = None,
    stature_m: Annotated[float | None, typer.Option("--stature-m", metavar="M", help="Stature, m.")] = None,
    mass_kg: Annotated[float | None, typer.Option("--mass-kg", metavar="KG", help="Mass, kg.")] = None,
    consent: Annotated[
        list[str] | None, typer.Option("--consent", metavar="SCOPE", help="coaching, research or sharing.")
    ] = None,
    withdraw: Annotated[bool, typer.Option("--withdraw", help="Withdraw all consent.")] = False,
    guardian: Annotated[bool, typer.Option("--guardian", help="A guardian consents.")] = False,
    on: Annotated[
        str | None, typer.Option("--on", metavar="DATE", help="Day of the consent; default: today.")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="TEXT", help="The person's name, for the file of names only."),
    ] = None,
    names: Annotated[
        Path | None, typer.Option("--names", metavar="FILE", help="File of names, outside the season.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Make a pseudonym for an athlete, or change attributes and consent.

    A pseudonym is random. Names of people stay in a file of their own, outside the season.
    """
    from oarlock.season import changed_athlete
    from oarlock.season.add import keep_name

    season = opened(at)
    known = {
        key: value for key, value in (("stature_m", stature_m), ("mass_kg", mass_kg)) if value is not None
    }
    one = changed_athlete(
        season, pseudonym, known, consent or [], withdrawn=withdraw, guardian=guardian, on=on
    )
    if name is not None or names is not None:
        keep_name(season, one.pseudonym, name, names)
    if json_output:
        return print_json(one)
    say(one.pseudonym)
