"""`oarlock lab compare`: estimators of the literature on the same recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.options import (
    CalibrationFile,
    Force,
    Json,
    ModelName,
    OutFolder,
    Settings,
    assignments,
    example,
)
from oarlock.cli.terminal import (
    UsageError,
    heading,
    number,
    output_folder,
    pairs,
    print_json,
    progress,
    say,
    steps,
    table,
    verb,
)
from oarlock.evaluation.comparison.estimators import estimator, estimators

if TYPE_CHECKING:
    from oarlock.evaluation.comparison.comparison import Comparison
    from oarlock.evaluation.comparison.estimators import Estimator
    from oarlock.evaluation.comparison.scores import Score

PAGE = "compare.html"
ALL = "all"


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "compare",
        epilog=example(
            "oarlock lab compare trial --model sculler --out compared",
            "oarlock lab compare trial --model sculler --filter ukf --filter limbs --filter vqf --out compared",
            "oarlock lab compare trial trial/truth --model sculler --repeats 3 --out compared --json | jq .wins",
        )
        + "\n\n\b\nFilters:\n"
        + "\n".join(
            f"  {e.name:<20} {e.title}" for e in estimators() if not e.name.endswith(("open", "plain"))
        )
        + "\n  NAME_open, NAME_plain, NAME_open_plain   of trees and limbs: no closures, no biases or base\n"
        "                       acceleration, neither\n"
        "  all                  all filters",
    )(compare)


@verb
def compare(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="A recording folder.")],
    model: ModelName,
    out: OutFolder,
    truth: Annotated[
        Path | None,
        typer.Argument(
            metavar="TRUTH",
            help="Track folder with the ground truth; default: RECORDING/truth; else the first filter is compared to.",
        ),
    ] = None,
    filters: Annotated[
        list[str] | None,
        typer.Option("--filter", metavar="NAME", help="Filter to run, see below. Repeatable."),
    ] = None,
    calibration: CalibrationFile = None,
    settings: Settings = None,
    start_s: Annotated[
        float,
        typer.Option("--start-s", metavar="S", help="Exclude the first seconds, in which filters converge."),
    ] = 2.0,
    repeats: Annotated[
        int, typer.Option("--repeats", metavar="N", min=1, help="Run each N times; the shortest time counts.")
    ] = 1,
    html: Annotated[bool, typer.Option("--html/--no-html", help="Write compare.html.")] = True,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Run several estimators on a recording: errors, consistency and time per step, in one table and page."""
    import oarlock

    body = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    chosen = _chosen(filters)
    measured = oarlock.load_recording(recording)
    place = truth_folder(recording if truth is None else truth)
    known = None if truth is None and place == recording else oarlock.load_track(place)
    wearing = oarlock.load_calibration(calibration) if calibration is not None else None
    with output_folder(out, "comparison", force) as stage:
        found = oarlock.studies.compare(
            body,
            measured,
            known,
            chosen,
            calibration=wearing,
            start_s=start_s,
            repeats=repeats,
            progress=progress,
        )
        found.save(stage)
        if html:
            _write_page(found, stage, recording)
    page = out / PAGE if html else None
    if json_output:
        print_json(found.to_dict() | {"out": out, "page": page})
        return
    _write(found, recording)
    say(f"\nWrote {out}: compare.toml, compare.csv" + (", compare.html" if page else ""))
    if page:
        steps(f"open {page}")


def _chosen(names: list[str] | None) -> list[Estimator] | None:
    if names is None:
        return None
    if ALL in names:
        return list(estimators())
    try:
        return [estimator(name) for name in dict.fromkeys(names)]
    except ValueError as error:
        raise UsageError(f"--filter: {error}") from None


def _write_page(found: Comparison, folder: Path, recording: Path) -> None:
    from oarlock.report.comparison import write_comparison

    write_comparison(found, folder / PAGE, f"Filters on {recording.name}")


_HEADERS = {
    "mean_rmse_deg": (">mean", ".3f"),
    "worst_rmse_deg": (">worst", ".3f"),
    "correlation": (">corr.", ".4f"),
    "nees_per_state": (">NEES", ".3g"),
    "coverage_95": (">95 %", ".3f"),
    "step_us": (">us", ".0f"),
}


def _write(found: Comparison, recording: Path) -> None:
    say(f"{len(found.scores)} filters on {recording}", style="bold")
    against = "truth" if found.reference == "truth" else f"{found.reference} (no ground truth)"
    say(
        f"RMSE against {against}, without the first {found.start_s:g} s: mean and worst of the {len(found.joints)} "
        "joints\nbetween root and inertial units, deg; slides and positions, mm; us a step",
        style="dim",
    )
    say()
    names = [n for n in found.columns if n not in ("steps_per_s", "kinematics_us")]
    heads = [_head(name) for name in names]
    wins = found.wins
    table(
        ["filter", *(head for head, _ in heads)],
        [
            (row.name, *(_cell(row, n, f, wins) for n, (_, f) in zip(names, heads, strict=True)))
            for row in found.scores
        ],
    )
    say("* best, or within 2 % of the best; - no standard deviations", style="dim", indent=2)
    _write_wins(found)
    heading("Time", "us: processor time of the filter alone, for all sensors of one sample")
    by_hand = [row for row in found.scores if number(row.kinematics_us, ".0f", "") != ""]
    if by_hand:
        us = sorted(row.kinematics_us for row in by_hand)
        say(
            f"filters on single inertial units also need inverse kinematics (NumPy, {us[0]:.0f} to {us[-1]:.0f} us\n"
            "a step, not counted above); filters of ahrs run in Python, the others compiled or in NumPy",
            indent=2,
        )
    for name, why in found.left_out.items():
        say(f"{name} was not run: {why}", style="yellow")


def _head(name: str) -> tuple[str, str]:
    if name in _HEADERS:
        return _HEADERS[name]
    short = name.removesuffix("_position_mm").removesuffix("_rmse_mm")
    return f">{short}", ".1f"


def _cell(row: Score, name: str, style: str, wins: dict[str, tuple[str, ...]]) -> str:
    text = number(row.columns().get(name), style)
    return f"{text}*" if row.name in wins.get(name, ()) else f"{text} "


def _write_wins(found: Comparison) -> None:
    heading("Best", "the first if several are equal")
    rows: dict[str, list[str]] = {}
    for name, who in found.wins.items():
        if name != "steps_per_s":
            rows.setdefault(who[0], []).append(_words(name))
    pairs([(f"  {who}", ", ".join(columns)) for who, columns in rows.items()])


def _words(name: str) -> str:
    return {
        "mean_rmse_deg": "mean angle",
        "worst_rmse_deg": "worst angle",
        "correlation": "correlation",
        "nees_per_state": "NEES",
        "coverage_95": "95 % bands",
        "step_us": "time per step",
    }.get(name, name.removesuffix("_mm").removesuffix("_rmse").replace("_", " "))
