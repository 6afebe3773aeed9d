"""`oarlock lab study`: measures how errors depend on sensors, noise, mounts, rates and settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import typer

from oarlock.cli.show import show_document
from oarlock.cli.terminal import UsageError, heading, number, output_folder, progress, say, steps, table
from oarlock.cli.verbs import command

_MEAN: Final = {
    "scenario": ("name", ""),
    ">mean deg": ("rmse_mean", ".3f"),
    ">SD": ("rmse_sd", ".3f"),
    ">worst seed": ("rmse_worst", ".3f"),
    ">in 95 % band": ("coverage_95_mean", ".0%"),
    ">failed": ("failed", ""),
}
_FAULTS: Final = {
    "fault": ("fault", ""),
    "strength": ("strength", ""),
    ">median deg": ("rmse_median_deg", ".3f"),
    ">worst seed": ("rmse_greatest_deg", ".3f"),
    ">in 95 % band": ("coverage_95_median", ".0%"),
    ">lost": ("lost", ""),
    ">adds deg": ("cost_median_deg", ".3f"),
}
"""Column of the terminal -> of the tables, and the format of its numbers."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock lab study which_sensors --out sensors",
        "oarlock lab study robustness_quick --out robust",
        "oarlock lab study mount_error --seeds 20 --jobs 2 --out mounts",
        "oarlock lab study my.toml --keys",
        show=_show,
        continues=True,
        metavars={"file": "NAME|FILE", "out": "FOLDER"},
        bounds={"seeds": (1, None)},
    )(study)


def study(
    file: str,
    *,
    out: Path | None = None,
    seeds: int | None = None,
    jobs: int | None = None,
    keys: bool = False,
    force: bool,
) -> dict[str, Any]:
    """Run a study: write tables of every run, a summary, and plots with bands over the seeds.

    Ctrl-C keeps the finished runs; the same command continues from there.

    Args:
        file: a shipped study, or a file; docs/study.md lists its keys.
        out: folder to write.
        seeds: use seeds 0 to N-1 instead of the file's.
        jobs: parallel processes; default: all cores.
        keys: list what this study can vary in addition to config.*, parameters.* and model.*, and exit.
        force: replace what is there.
    """
    from oarlock.evaluation.study.costs import doses
    from oarlock.evaluation.study.pool import UNFINISHED, all_rows, forget
    from oarlock.evaluation.study.result import KIND, StudyResult
    from oarlock.report.study_page import study_page
    from oarlock.rowing import SIMULATORS
    from oarlock.storage.write_file import write_file
    from oarlock.studies import load_study

    given = load_study(file, SIMULATORS, None if seeds is None else range(seeds))
    if keys:
        about = {name: {"default": key.default, "about": key.about} for name, key in given.keys.items()}
        return {"keys": about}
    if out is None:
        raise UsageError("--out FOLDER is missing: the folder for the results")
    with output_folder(out, KIND, force, beside=UNFINISHED) as stage:
        with progress(f"{given.run_count} runs") as share:
            result = StudyResult(given, tuple(all_rows(given, jobs, out, share)))
        result.save(stage)
        write_file(stage / "report.html", study_page(result))
    forget(out)
    document = {
        "title": given.title,
        "report": out / "report.html",
        "runs": given.run_count,
        "failed": len(result.failures),
    }
    if given.faults:
        return {**document, "faults": [dose.row() for dose in doses(given, result.rows)]}
    errors = dict.fromkeys(f"{row['name']}: {row['error']}" for row in result.complaints)
    return {
        **document,
        "mean": [row for row in result.summary() if row["kind"] == "mean"],
        "errors": list(errors),
    }


def _show(document: dict[str, Any]) -> None:
    """Of a study with faults each at its usual strength, the costliest first; of others the mean of the angles."""
    if "keys" in document:
        return show_document(document)
    rows, columns = document.get("mean", ()), _MEAN
    if "faults" in document:
        clean, *faulty = document["faults"]
        usual = [row for row in faulty if row["usual"] and row["setting"] == clean["setting"]]
        rows, columns = [clean, *sorted(usual, key=lambda row: -row["cost_median_deg"])], _FAULTS
    heading(document["title"], f"{document['runs']} runs, {document['failed']} failed")
    table(
        list(columns),
        [
            [number(row[name], style) if style else row[name] or "" for name, style in columns.values()]
            for row in rows
        ],
    )
    for error in document.get("errors", ()):
        say(error, style="red", indent=2)
    report = document["report"]
    say(f"\nWrote {report.parent}: tables (.csv, .parquet), run.toml, {report.name}")
    steps(f"open {report}")
