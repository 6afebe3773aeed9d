"""`oarlock season setup` and `oarlock season run`: choose model and settings, and compute missing results."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import CalibrationFile, Json, ModelName, example
from oarlock.cli.season_options import SeasonAt, opened
from oarlock.cli.season_tables import show_list
from oarlock.cli.terminal import (
    EXIT_DATA,
    UsageError,
    continuing_verb,
    page,
    pairs,
    print_json,
    progress,
    say,
    steps,
    verb,
)

if TYPE_CHECKING:
    from oarlock.season.run import Executor, Plan, RunCounts


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    group.command(
        "setup",
        epilog=example(
            "oarlock season setup season --model sculler",
            "oarlock season setup season --model sculler --calibration k7.toml --athlete K7QMVA",
        ),
    )(setup)
    group.command(
        "run",
        epilog=example(
            "oarlock season run season --dry-run",
            "oarlock season run season --jobs 2",
            "oarlock season run season --again-failed --task-limit-s 1800",
            "oarlock season run /share/season --scheduler tcp://10.0.0.7:8786",
        ),
    )(run)


@verb
def setup(
    at: SeasonAt,
    model: ModelName,
    calibration: CalibrationFile = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            "--settings", metavar="FILE", help="Settings of the filter: a TOML file, or an earlier run.toml."
        ),
    ] = None,
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="PSEUDONYM", help="Only for this athlete.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Store the model, calibration and settings with which `season run` computes from now on."""
    from oarlock import load_calibration, load_model
    from oarlock.cli.settings import configuration, settings_of_file
    from oarlock.season.compute import choose_setup, make_setup

    body = load_model(model)
    config = configuration(body, settings_of_file(settings) if settings is not None else {})
    wearing = None if calibration is None else load_calibration(calibration)
    made = make_setup(body, wearing, config)
    choose_setup(opened(at), made, athlete)
    if json_output:
        return print_json({"setup": made.name, "athlete": athlete})
    whose = "every athlete without a setup of their own" if athlete is None else athlete
    say(f"Setup {made.name} is current for {whose}")
    steps(f"oarlock season run {at} --dry-run", f"oarlock season run {at}")


@continuing_verb
def run(
    at: SeasonAt,
    workers: Annotated[
        int | None,
        typer.Option(
            "--jobs", metavar="N", min=1, help="Processes of this machine; default: one for each core."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Use the workers of this Dask scheduler."),
    ] = None,
    limit_s: Annotated[
        float | None,
        typer.Option(
            "--task-limit-s",
            metavar="S",
            min=1.0,
            help="End a recording that takes longer; default: 300 s and 10 times its length.",
        ),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again-failed", help="Also repeat what failed with this setup and version.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be computed.")] = False,
    json_output: Json = False,
) -> None:
    """Compute the results that are missing or out of date: strokes of each recording, health of its sensors.

    Stop it with Ctrl-C; the same command continues. Recordings that fail are listed with the reason.
    """
    from oarlock.season.run import make_plan, run_season

    if workers is not None and scheduler is not None:
        raise UsageError("--jobs and --scheduler contradict each other: the cluster has its own workers")
    season = opened(at)
    plan = make_plan(season, again, limit_s)
    if plan.without_setup and not plan.jobs and not plan.there and not plan.failed:
        raise UsageError(f"no model was chosen yet. Choose one: `oarlock season setup {at} --model sculler`")
    if dry_run or not plan.jobs:
        return _show_plan(at, plan, dry_run, json_output)
    executor = _executor(workers, scheduler, len(plan.jobs))
    began_s = time.monotonic()
    with progress(f"computing {len(plan.jobs)} recordings") as share:
        outcome = run_season(season, executor, plan, share, lambda: make_plan(season, again, limit_s))
    if json_output:
        print_json({**_document(plan), **vars(outcome)})
    else:
        _show(at, plan, outcome, time.monotonic() - began_s)
    if outcome.failed:
        raise typer.Exit(EXIT_DATA)


def _executor(workers: int | None, scheduler: str | None, jobs: int) -> Executor:
    from oarlock.season.compute import run_job
    from oarlock.season.processes import Processes

    if scheduler is None:
        return Processes(run_job, min(workers or os.cpu_count() or 1, jobs))
    from oarlock.season.cluster import DaskCluster

    return DaskCluster(run_job, scheduler, lambda words: page(stderr=True).print(words, soft_wrap=True))


def _document(plan: Plan) -> dict[str, object]:
    return {
        "to_compute": len(plan.jobs),
        "hours": plan.hours,
        "up_to_date": plan.there,
        "failed_before": dict(plan.failed),
        "without_setup": list(plan.without_setup),
        "without_raw_data": plan.removed,
    }


def _show_plan(at: str, plan: Plan, dry_run: bool, json_output: bool) -> None:
    if json_output:
        return print_json({**_document(plan), "dry_run": dry_run})
    if not plan.jobs and not plan.without_setup:
        say("Everything is up to date.")
    pairs(
        [
            ("to compute", f"{len(plan.jobs)} recordings, {plan.hours:.1f} h" if plan.jobs else ""),
            ("up to date", plan.there),
            *_left_out(plan),
        ]
    )
    next_steps = [f"oarlock season setup {at} --model sculler"] if plan.without_setup else []
    next_steps += [f"oarlock season run {at}"] if plan.jobs else []
    next_steps += [f"oarlock season run {at} --again-failed"] if plan.failed else []
    if next_steps:
        steps(*next_steps)


def _left_out(plan: Plan) -> list[tuple[str, object]]:
    return [
        ("failed before", len(plan.failed) or ""),
        ("without a setup", len(plan.without_setup) or ""),
        ("without raw data", plan.removed or ""),
    ]


def _show(at: str, plan: Plan, outcome: RunCounts, took_s: float) -> None:
    say(f"Computed {outcome.computed} recordings in {_duration(took_s)}", style="bold")
    pairs(
        [
            ("failed", len(outcome.failed) or ""),
            ("stored by others", outcome.there or ""),
            ("up to date", plan.there or ""),
            *_left_out(plan),
            ("log", outcome.log),
        ]
    )
    failed = [f"{recording}: {words}" for recording, words in outcome.failed.items()]
    show_list("Failed", failed, rest=f"oarlock season questions {at} failed")


def _duration(seconds: float) -> str:
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    return (
        f"{hours} h {minutes} min" if hours else f"{minutes} min {whole % 60} s" if minutes else f"{whole} s"
    )
