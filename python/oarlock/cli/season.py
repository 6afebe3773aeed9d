"""`oarlock season`: a squad's recordings, results and questions in one place."""

from __future__ import annotations

import datetime
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.season_tables import show_answer, write_table
from oarlock.cli.session_options import METAVARS
from oarlock.cli.show import fields_of, show_document
from oarlock.cli.terminal import UsageError, free_file, progress, say
from oarlock.cli.verbs import Incomplete, NewFile, Pseudonym, command

if TYPE_CHECKING:
    import pyarrow as pa

    from oarlock import Calibration, Model
    from oarlock.cli.session_options import Session
    from oarlock.season import Athlete, Season, SeasonSummary, Selection
    from oarlock.season.run import Executor, Plan

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="A squad's recordings, results and questions in one place.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="season")


def _with_sentences(name: str) -> Callable[[dict[str, Any]], None]:
    """Prints a result whose rows of this name are sentences, too long for a table."""

    def show(document: dict[str, Any]) -> None:
        sentences = [": ".join(fields_of(row).values()) for row in document[name]]
        show_document({**document, name: sentences})

    return show


# --- contents -----------------------------------------------------------------------------------------


@command(
    group,
    "oarlock season init season --name 'Club 2026' --time-zone Europe/Berlin",
    "oarlock season init s3://club/season",
    metavars={"at": "SEASON", "name": "TEXT"},
)
def init(at: str, *, name: str = "season", time_zone: str = "UTC") -> dict[str, Any]:
    """Begin a season in a folder, on a share, or in an object store.

    The file system or the store decides who may read it: set permissions there.

    Args:
        at: folder of the season, or its address, such as s3://club/season.
        name: name of the season, for people.
        time_zone: zone of local times, such as Europe/Berlin.
    """
    from oarlock.season import create_season

    season = create_season(at, name, time_zone)
    then = [f"oarlock season athlete {at}", f"oarlock season add {at} RECORDING --athlete PSEUDONYM"]
    return {"season": at, "id": season.id, "name": name, "next": then}


@command(
    group,
    "oarlock season add season trial_1 trial_2 --athlete K7QMVA",
    "oarlock season add season recordings/* --names ~/names.toml",
    "oarlock season add season rp3.csv --athlete K7QMVA --date 2026-05-01",
    show=_with_sentences("refused"),
    continues=True,
    metavars={**METAVARS, "sources": "RECORDING|FILE", "athlete": "PSEUDONYM"},
)
def add(
    season: Season,
    sources: list[Path],
    *,
    session: Session,
    names: Path | None = None,
    cut_gps_m: float | None = None,
) -> dict[str, Any]:
    """Store recordings and devices' exports, each once; their names are hashes of their contents.

    Files that cannot be stored are listed with the reason; the others are stored.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        sources: folders of recordings, or devices' exports.
        session: who was recorded, when and where; replaces what session.toml says.
        names: pseudonyms by name; replaces names in session.toml.
        cut_gps_m: remove GPS positions this near to a track's start or end, m.
    """
    from oarlock.season import Admission, NamesFile
    from oarlock.storage.errors import DataError

    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file; `oarlock season athlete --names` makes it")
    mapping = None if names is None else NamesFile.read(names).pseudonyms
    admission = Admission(season, None, mapping, cut_gps_m)
    stored: list[dict[str, Any]] = []
    refused: list[dict[str, str]] = []
    notes: list[str] = []
    with progress("storing") as share:
        for done, source in enumerate(sources, start=1):
            try:
                added = admission.add(source, session)
            except DataError as error:
                refused.append({"source": str(source), "reason": str(error).removeprefix(f"{source}: ")})
            else:
                entry = added.entry
                about = {"recording": entry.recording, "athlete": entry.athlete, "start_utc": entry.start}
                stored.append(
                    {"source": str(source), "device": entry.device, **about, "is_new": added.is_new}
                )
                notes += [f"{source}: {note}" for note in added.notes]
            share(done / len(sources))
    new = sum(row["is_new"] for row in stored)
    if new and names is None:
        notes.append("Names of files are stored with --names FILE alone: a person's name may be in them.")
    document = {
        "new": new,
        "there_before": len(stored) - new,
        "stored": stored,
        "refused": refused,
        "notes": notes,
    }
    if refused:
        raise Incomplete(document)
    return document


@command(group, "oarlock season list season", "oarlock season list season --json")
def list_(season: Season) -> SeasonSummary:
    """Show athletes, recordings, results and failures of a season.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
    """
    from oarlock.season import season_summary

    return season_summary(season)


@command(
    group,
    "oarlock season check season",
    "oarlock season check season --repair",
    show=_with_sentences("findings"),
)
def check(season: Season, *, repair: bool = False) -> dict[str, Any]:
    """Compare every file with its hash; list damaged and unfinished files.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        repair: remove damaged results and tables; `run` makes them again.
    """
    from oarlock.season import upkeep

    with progress("checking") as share:
        faults = upkeep.check(season, share)
    removed = upkeep.repair(season, faults) if repair else []
    offered = not repair and any(fault.is_repairable for fault in faults)
    then = [f"oarlock season check {season.place.address} --repair"] if offered else []
    document = {"in_order": not faults, "findings": faults, "removed": removed, "next": then}
    if any(fault.is_damage for fault in faults):
        raise Incomplete(document)
    return document


@command(group, "oarlock season prune season --dry-run", "oarlock season prune season")
def prune(season: Season, *, dry_run: bool = False) -> dict[str, Any]:
    """Remove replaced results, data older than the retention time, and files of commands that were stopped.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        dry_run: only show what would be removed.
    """
    from oarlock.season.upkeep import prune as pruned

    removals = pruned(season, datetime.datetime.now(datetime.UTC).date(), dry_run)
    total = sum(removal.bytes for removal in removals)
    return {"dry_run": dry_run, "folders": len(removals), "bytes": total, "removals": removals}


@command(
    group,
    "oarlock season athlete season --stature-m 1.86 --mass-kg 82",
    "oarlock season athlete season --name 'Anna Muster' --names ~/names.toml",
    "oarlock season athlete season --athlete K7QMVA --consent coaching --on 2026-03-01",
    show=lambda athlete: say(athlete.pseudonym),
    metavars={"consent": "SCOPE", "on": "DATE", "name": "TEXT"},
)
def athlete(
    season: Season,
    *,
    athlete: Pseudonym | None = None,
    stature_m: float | None = None,
    mass_kg: float | None = None,
    consent: list[str] | None = None,
    withdraw: bool = False,
    guardian: bool = False,
    on: str | None = None,
    name: str | None = None,
    names: Path | None = None,
) -> Athlete:
    """Make a pseudonym for an athlete, or change attributes and consent.

    A pseudonym is random. Names of people stay in a file of their own, outside the season.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        athlete: change this athlete; default: a new one.
        stature_m: stature, m.
        mass_kg: mass, kg.
        consent: coaching, research or sharing.
        withdraw: withdraw all consent.
        guardian: a guardian consents.
        on: day of the consent; default: today.
        name: the person's name, for the file of names only.
        names: file of names, outside the season.
    """
    from oarlock.season import changed_athlete
    from oarlock.season.add import keep_name

    numbers = {"stature_m": stature_m, "mass_kg": mass_kg}
    attributes = {key: number for key, number in numbers.items() if number is not None}
    changed = changed_athlete(
        season, athlete, attributes, consent or [], withdrawn=withdraw, guardian=guardian, on=on
    )
    if name is not None or names is not None:
        keep_name(season, changed.pseudonym, name, names)
    return changed


# --- results ------------------------------------------------------------------------------------------


@command(
    group,
    "oarlock season setup season --model sculler",
    "oarlock season setup season --model sculler --calibration k7.toml --athlete K7QMVA",
)
def setup(
    season: Season,
    *,
    model: Model,
    calibration: Calibration | None = None,
    settings: Path | None = None,
    athlete: Pseudonym | None = None,
) -> dict[str, Any]:
    """Store the model, calibration and settings with which `season run` computes from now on.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        model: name of a shipped model, or a model file.
        calibration: calibration file with mounts and lengths.
        settings: settings of the filter: a TOML file, or an earlier run.toml.
        athlete: only for this athlete; default: for all without a setup of their own.
    """
    from oarlock.cli.settings import configuration, settings_of_file
    from oarlock.season.compute import choose_setup, make_setup

    config = configuration(model, {} if settings is None else settings_of_file(settings))
    made = make_setup(model, calibration, config)
    choose_setup(season, made, athlete)
    at = season.place.address
    then = [f"oarlock season run {at} --dry-run", f"oarlock season run {at}"]
    return {"setup": made.name, "athlete": athlete, "next": then}


@command(
    group,
    "oarlock season run season --dry-run",
    "oarlock season run season --jobs 2",
    "oarlock season run season --again-failed --task-limit-s 1800",
    "oarlock season run /share/season --scheduler tcp://10.0.0.7:8786",
    continues=True,
    metavars={"scheduler": "ADDRESS"},
    bounds={"task_limit_s": (1.0, None)},
)
def run(
    season: Season,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    task_limit_s: float | None = None,
    again_failed: bool = False,
    dry_run: bool = False,
) -> dict[str, Any]:
    """Compute the results that are missing or out of date: strokes of each recording, health of its sensors.

    Stop it with Ctrl-C; the same command continues. Recordings that fail are listed with the reason.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        jobs: processes of this machine; default: one for each core.
        scheduler: use the workers of this Dask scheduler.
        task_limit_s: end a recording that takes longer; default: 300 s and 10 times its length.
        again_failed: also repeat what failed with this setup and version.
        dry_run: only show what would be computed.
    """
    from oarlock.season.run import make_plan, run_season

    if jobs is not None and scheduler is not None:
        raise UsageError("--jobs and --scheduler contradict each other: the cluster has its own workers")
    at = season.place.address
    plan = make_plan(season, again_failed, task_limit_s)
    if plan.without_setup and not plan.jobs and not plan.there and not plan.failed:
        raise UsageError(f"no model was chosen yet. Choose one: `oarlock season setup {at} --model sculler`")
    document = {
        "to_compute": len(plan.jobs),
        "hours": plan.hours,
        "up_to_date": plan.there,
        "failed_before": plan.failed,
        "without_setup": plan.without_setup,
        "without_raw_data": plan.removed,
    }
    if dry_run or not plan.jobs:
        then = [f"oarlock season setup {at} --model sculler"] if plan.without_setup else []
        then += [f"oarlock season run {at}"] if plan.jobs else []
        then += [f"oarlock season run {at} --again-failed"] if plan.failed else []
        return {**document, "dry_run": dry_run, "next": then}
    executor, began_s = _executor(jobs, scheduler, plan), time.monotonic()
    with progress(f"computing {len(plan.jobs)} recordings") as share:
        done = run_season(
            season, executor, plan, share, lambda: make_plan(season, again_failed, task_limit_s)
        )
    document |= {
        "computed": done.computed,
        "computed_by_others": done.there,
        "elapsed_s": time.monotonic() - began_s,
        "log": done.log,
        "failed": done.failed,
    }
    if done.failed:
        raise Incomplete({**document, "next": [f"oarlock season questions {at} failed"]})
    return document


def _executor(jobs: int | None, scheduler: str | None, plan: Plan) -> Executor:
    from oarlock.season.compute import run_job
    from oarlock.season.processes import Processes

    if scheduler is None:
        return Processes(run_job, min(jobs or os.cpu_count() or 1, len(plan.jobs)))
    from oarlock.season.cluster import DaskCluster

    return DaskCluster(run_job, scheduler, lambda words: typer.echo(words, err=True))


# --- questions ----------------------------------------------------------------------------------------


def selection_of(
    *,
    athlete: Pseudonym | None = None,
    boat: str | None = None,
    class_: str | None = None,
    since: datetime.date | None = None,
    until: datetime.date | None = None,
    scope: str | None = None,
) -> Selection:
    """What of a season is asked.

    Args:
        athlete: only this athlete.
        boat: only in this boat.
        class_: only this class of comparable runs.
        since: first day, such as 2026-03-01.
        until: last day.
        scope: only athletes who consent to: coaching, research, sharing.
    """
    from oarlock.season import Selection

    return Selection(athlete, boat, class_, since, until, scope)


@command(
    group,
    "oarlock season questions season",
    "oarlock season questions season drift --metric catch_angle --rate-spm 20-24",
    "oarlock season questions season crew --boat '2x Heron' --csv crew.csv",
    show=show_answer,
    metavars={"question": "QUESTION", "rate_spm": "LOW-HIGH", "boat": "TEXT"},
)
def questions(
    season: Season,
    question: str | None = None,
    *,
    metric: str | None = None,
    rate_spm: str | None = None,
    selection: Selection,
    csv: NewFile | None = None,
    parquet: NewFile | None = None,
) -> dict[str, Any]:
    """List the ready questions, or ask one.

    Means have 95 % bands. Results of different engines, models or calibrations are never compared.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        question: the one to ask; default: list all.
        metric: number of a stroke, such as catch_angle.
        rate_spm: only strokes at these rates, such as 20-24.
        selection: what of the season.
        csv: write all rows as CSV.
        parquet: write all rows as Parquet.
    """
    from oarlock.season import QUESTIONS, Database, left_out
    from oarlock.season.questions import answer, question_named

    if question is None:
        at = season.place.address
        then = [
            f"oarlock season questions {at} drift --metric catch_angle",
            f"oarlock season query {at} \"FROM drift('catch_angle_rad')\"",
        ]
        listed = [{"question": ready.name, "answers": ready.line} for ready in QUESTIONS]
        return {"questions": listed, "next": then}
    asked = question_named(question)
    if asked.of_metric and metric is None:
        raise UsageError(f"the question {asked.name} needs a metric, such as --metric catch_angle")
    with Database(season, selection) as database:
        column = database.metric(metric) if asked.of_metric and metric is not None else None
        rows = answer(database, asked.name, column, rate_spm)
        notes = left_out(database, asked.name, column, rate_spm)
    answered = {"question": asked.name, "metric": column, **_rows_or_files(rows, csv, parquet)}
    return {**answered, "notes": notes}


@command(
    group,
    "oarlock season trend season --athlete K7QMVA --metric catch_angle --rate-spm 20-24",
    "oarlock season trend season --metric catch_factor --since 2026-03-01",
    show=show_answer,
    metavars={"rate_spm": "LOW-HIGH", "boat": "TEXT"},
)
def trend(
    season: Season, *, metric: str, rate_spm: str | None = None, selection: Selection
) -> dict[str, Any]:
    """Show a metric month by month, with 95 % bands; without --athlete, the change of each athlete.

    Strokes are weighted by their uncertainty. Means are corrected to the athlete's usual stroke rate.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        metric: number of a stroke, such as catch_angle.
        rate_spm: only strokes at these rates, such as 20-24.
        selection: what of the season.
    """
    from oarlock.season import trend as trend_of

    if selection.athlete is None:
        return questions(season, "changes", metric=metric, rate_spm=rate_spm, selection=selection)
    answer = trend_of(season, selection.athlete, metric, rate_spm, selection)
    return {**vars(answer), "months": answer.months.to_pylist()}


@command(
    group,
    'oarlock season query season "SELECT athlete, count(*) FROM recordings GROUP BY athlete"',
    "oarlock season query season \"FROM trend('catch_angle_rad', rate_from := 20)\" --csv trend.csv",
    'oarlock season query season "DESCRIBE strokes"',
    show=show_answer,
    metavars={"sql": "SQL"},
)
def query(
    season: Season,
    sql: str,
    *,
    scope: str | None = None,
    csv: NewFile | None = None,
    parquet: NewFile | None = None,
) -> dict[str, Any]:
    """Ask in SQL: tables strokes, recordings, runs and athletes, and all ready questions.

    Nothing can be changed, and no other file can be read. Numbers are SI and radians.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        sql: one statement that reads.
        scope: only athletes who consent to: coaching, research, sharing.
        csv: write all rows as CSV.
        parquet: write all rows as Parquet.
    """
    from oarlock.season import Database, Selection

    with Database(season, Selection(scope=scope)) as database:
        return _rows_or_files(database.table(sql), csv, parquet)


def _rows_or_files(rows: pa.Table, *files: Path | None) -> dict[str, Any]:
    """The rows, or the files of CSV and Parquet to which they went."""
    written = [file for file in files if file is not None]
    for kind, file in zip(("csv", "parquet"), files, strict=True):
        if file is not None:
            write_table(rows, file, kind)
    return {"row_count": rows.num_rows, "written": written} if written else {"rows": rows.to_pylist()}


@command(
    group,
    "oarlock season page season --out season.html",
    "oarlock season page season --out pages --athlete K7QMVA --metric catch_angle --metric rhythm",
)
def page(
    season: Season,
    *,
    out: Path,
    athlete: Pseudonym | None = None,
    metric: list[str] | None = None,
    class_: str | None = None,
    scope: str | None = None,
    force: bool,
) -> dict[str, Any]:
    """Write a season as a page that works offline: sessions, changes, trends, sensor health.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        out: file to write, or a folder for season.html.
        athlete: only this athlete.
        metric: number of a stroke, such as catch_angle. Repeatable.
        class_: compare this class of runs.
        scope: only athletes who consent to: coaching, research, sharing.
        force: replace the file.
    """
    from oarlock.season import Selection, write_season_page

    target = out / "season.html" if out.is_dir() or not out.suffix else out
    free_file(target, force)
    written = write_season_page(season, target, metric, Selection(athlete, scope=scope), class_)
    return {"bytes": written.stat().st_size, "written": written}


# --- privacy ------------------------------------------------------------------------------------------


@command(
    group,
    "oarlock season export season --athlete K7QMVA --out mine",
    "oarlock season export season --scope sharing --out shared --cut-gps-m 200",
    metavars={"out": "FOLDER", "scope": "SCOPE"},
)
def export(
    season: Season,
    *,
    out: Path,
    athlete: Pseudonym | None = None,
    scope: str | None = None,
    cut_gps_m: float | None = None,
) -> dict[str, Any]:
    """Write all data of an athlete, or of all who consent to a use, into a folder: as CSV and as stored.

    The season remembers the folder, so that `erase` also removes it.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        out: folder outside the season; a new one.
        athlete: everything of this athlete.
        scope: only who consents to this: coaching, research or sharing.
        cut_gps_m: remove GPS positions this near to a track's start or end, m.
    """
    from oarlock.season.exports import export_athlete, may_share

    if athlete is None and scope is None:
        raise UsageError("give --athlete PSEUDONYM, or --scope for all who consent to a use")
    willing, others = may_share(season, scope) if scope is not None else ([str(athlete)], [])
    if athlete is not None and athlete in others:
        raise UsageError(
            f"{athlete} has not consented to {scope}, or has withdrawn the consent; nothing was exported"
        )
    chosen, exported = willing if athlete is None else [athlete], []
    for name in chosen:
        with progress(f"exporting {name}") as share:
            exported.append(export_athlete(season, name, out, cut_gps_m=cut_gps_m, progress=share))
    return {"exported": exported, "left_out_without_consent": others if athlete is None else []}


@command(
    group,
    "oarlock season erase season --athlete K7QMVA --dry-run",
    "oarlock season erase season --athlete K7QMVA --names ~/names.toml --yes",
    continues=True,
)
def erase(
    season: Season,
    *,
    athlete: Pseudonym,
    names: Path | None = None,
    dry_run: bool = False,
    yes: bool = False,
) -> dict[str, Any]:
    """Remove the folder of an athlete for good, and its former versions on S3; then list what is left.

    Backups, and texts of other athletes, are not searched.

    Args:
        season: folder of the season, or its address, such as s3://club/season.
        athlete: who is erased.
        names: file of names: the person's name is removed from it.
        dry_run: only show what would be removed.
        yes: remove it; it cannot be undone.
    """
    from oarlock.season.athletes import NamesFile
    from oarlock.season.erase import erase as erased

    if dry_run == yes:
        raise UsageError("give --dry-run to see what would be removed, or --yes to remove it for good")
    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file")
    known = None if names is None else NamesFile.read(names)
    erasure = erased(season, athlete, dry_run=dry_run)
    again = f"oarlock season erase {season.place.address} --athlete {athlete}"
    again += f"{'' if names is None else f' --names {names}'} --yes"
    notes, then = [], []
    if known is not None and athlete not in known.pseudonyms.values():
        notes.append(f"{names} has no name for {athlete}.")
    elif known is not None and yes:
        known.without(athlete).write()
        notes.append(f"Removed the name from {names}.")
    if dry_run:
        notes, then = [*notes, "Nothing was removed: these numbers are what --yes removes."], [again]
    elif erasure.is_proven:
        notes.append(f"Listed the folder again: nothing of {athlete} is left.")
    else:
        notes.append("The erasure is not proven: remove what is listed above, then erase again.")
        then = [f"oarlock season check {season.place.address}", again]
    document = {**vars(erasure), "is_proven": erasure.is_proven, "notes": notes, "next": then}
    if yes and not erasure.is_proven:
        raise Incomplete(document)
    return document
