"""`oarlock lab study`: measures how errors depend on sensors, noise, mounts, rates and settings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Force, Jobs, Json, example
from oarlock.cli.terminal import (
    UsageError,
    continuing_verb,
    heading,
    number,
    output_folder,
    print_json,
    progress,
    say,
    steps,
    table,
)

if TYPE_CHECKING:
    from oarlock.evaluation.study.costs import Dose
    from oarlock.evaluation.study.result import StudyResult
    from oarlock.studies import Study


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "study",
        epilog=example(
            "oarlock lab study which_sensors --out sensors",
            "oarlock lab study robustness_quick --out robust",
            "oarlock lab study mount_error --seeds 20 --jobs 2 --out mounts",
            "oarlock lab study my.toml --keys",
        ),
    )(study)


@continuing_verb
def study(
    file: Annotated[
        str,
        typer.Argument(metavar="NAME|FILE", help="A shipped study, or a file; docs/study.md lists its keys."),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FOLDER", help="Folder to write.")
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option("--seeds", metavar="N", min=1, help="Use seeds 0 to N-1 instead of the file's."),
    ] = None,
    jobs: Jobs = None,
    keys: Annotated[bool, typer.Option("--keys", help="List what this study can vary, and exit.")] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Run a study: write tables of every run, a summary, and plots with bands over the seeds.

    Ctrl-C keeps the finished runs; the same command continues from there.
    """
    from oarlock.evaluation.study.pool import UNFINISHED, all_rows, forget
    from oarlock.evaluation.study.result import KIND, StudyResult
    from oarlock.report.study_page import study_page
    from oarlock.rowing import SIMULATORS
    from oarlock.storage.write_file import write_file
    from oarlock.studies import load_study

    given = load_study(file, SIMULATORS, None if seeds is None else range(seeds))
    if keys:
        _write_keys(given, json_output)
        return
    if out is None:
        raise UsageError("--out FOLDER is missing: the folder for the results")
    report = out / "report.html"
    with output_folder(out, KIND, force, beside=UNFINISHED) as stage:
        with progress(f"{given.run_count} runs") as told:
            result = StudyResult(given, tuple(all_rows(given, jobs, out, told)))
        result.save(stage)
        write_file(stage / report.name, study_page(result))
    forget(out)
    if json_output and given.faults:
        print_json(_of_faults(result, report))
        return
    if json_output:
        summary = [row for row in result.summary() if row["kind"] == "mean"]
        print_json(
            {"report": report, "runs": given.run_count, "failed": len(result.failures), "mean": summary}
        )
        return
    tables = "runs, summary and faults" if given.faults else "runs and summary"
    (_write_faults if given.faults else _write)(result)
    say(f"\nWrote {out}: {tables} (.csv, .parquet), run.toml, report.html")
    steps(f"open {report}")


def _write(result: StudyResult) -> None:
    study = result.study
    heading(study.title, f"{study.run_count} runs, mean RMSE of the angles over {len(study.seeds)} seeds")
    found = {row["scenario"]: row for row in result.summary() if row["kind"] == "mean"}
    rows = []
    for scenario in study.expanded():
        row = found.get(scenario.index)
        if row is None:
            rows.append((scenario.name, "-", "-", "-", "-", "none, see below"))
            continue
        rows.append(
            (
                scenario.name,
                number(row["rmse_mean"], ".3f"),
                number(row["rmse_sd"], ".3f"),
                number(row["rmse_worst"], ".3f"),
                number(100.0 * row["coverage_95_mean"], ".0f"),
                f"{row['failed']} failed" if row["failed"] else "",
            )
        )
    table(["scenario", ">mean deg", ">SD", ">worst seed", ">in 95 % band %", "note"], rows)
    for text in list(dict.fromkeys(f"{row['name']}: {row['error']}" for row in result.complaints))[:5]:
        say(text, style="red", indent=2)


def _of_faults(result: StudyResult, report: Path) -> dict[str, object]:
    from oarlock.evaluation.study.costs import doses

    failed = len(result.failures)
    rows = [dose.row() for dose in doses(result.study, result.rows)]
    return {"report": report, "runs": result.study.run_count, "failed": failed, "faults": rows}


def _write_faults(result: StudyResult) -> None:
    from oarlock.evaluation.study.costs import doses, ranked

    study, found = result.study, doses(result.study, result.rows)
    setting = found[0].setting
    heading(
        study.title,
        f"{study.run_count} runs, {len(study.seeds)} seeds; each fault at its typical strength",
    )
    usual = {
        d.fault.name: d for d in found if d.fault and d.setting == setting and d.index == d.fault.usual_index
    }
    rows = [("no fault", *_cells(found[0]), "")]
    for fault in ranked(found):
        dose = usual[fault.name]
        adds = number(dose.cost_deg, ".3f", "lost") if dose.noticed else "nothing"
        rows.append((fault.sentence(dose.index), *_cells(dose), adds))
    table(["fault", ">median deg", ">worst seed", ">in 95 % band %", ">lost", ">adds deg"], rows)


def _cells(dose: Dose) -> tuple[str, str, str, str]:
    from oarlock.evaluation.study.costs import middle

    worst = number(dose.range_deg[1], ".3f", "lost")
    inside = number(100.0 * middle(dose.coverage), ".0f")
    return number(dose.median_deg, ".3f", "lost"), worst, inside, str(dose.lost or "")


def _write_keys(study: Study, as_json: bool) -> None:
    keys = study.keys
    if as_json:
        print_json({name: {"default": key.default, "about": key.about} for name, key in keys.items()})
        return
    heading("Keys", "in addition to config.*, parameters.* and model.*")
    from oarlock.evaluation.study.spec import shown

    table(["key", "default", "what"], [(name, shown(key.default), key.about) for name, key in keys.items()])
