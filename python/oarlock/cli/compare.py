"""`oarlock lab compare`: estimators of the literature on the same recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.show import label
from oarlock.cli.terminal import UsageError, number, output_folder, progress, say, steps, table
from oarlock.cli.verbs import NewFolder, command
from oarlock.evaluation.comparison.estimators import estimator, estimators

if TYPE_CHECKING:
    from oarlock import Calibration
    from oarlock.cli.body import Body as SizedBody

PAGE = "compare.html"
ALL = "all"
_COLUMNS = {
    "mean_rmse_deg": ("mean", ".3f"),
    "worst_rmse_deg": ("worst", ".3f"),
    "correlation": ("corr.", ".4f"),
    "nees_per_state": ("NEES", ".3g"),
    "coverage_95": ("95 %", ".3f"),
    "step_us": ("us", ".0f"),
}
"""Column -> its head and the format of its numbers; others are lengths, mm."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    shown = (e for e in estimators() if not e.name.endswith(("open", "plain")))
    command(
        app,
        "oarlock lab compare trial --model sculler --out compared",
        "oarlock lab compare trial --model sculler --filter ukf --filter limbs --filter vqf --out compared",
        "oarlock lab compare trial trial/truth --model sculler --repeats 3 --out compared --json | jq .wins",
        epilog="\b\nFilters:\n"
        + "\n".join(f"  {e.name:<20} {e.title}" for e in shown)
        + "\n  NAME_open, NAME_plain, NAME_open_plain   of trees and limbs: no closures, no biases or base\n"
        "                       acceleration, neither\n"
        "  all                  all filters",
        show=_show,
        metavars={"recording": "RECORDING", "truth": "TRUTH"},
        bounds={"repeats": (1, None)},
    )(compare)


def compare(
    recording: Path,
    truth: Path | None = None,
    *,
    model: SizedBody,
    out: NewFolder,
    filter_: list[str] | None = None,
    calibration: Calibration | None = None,
    start_s: float = 2.0,
    repeats: int = 1,
    html: bool = True,
    force: bool,
) -> dict[str, Any]:
    """Run several estimators on a recording: errors, consistency and time per step, in one table and page.

    Args:
        recording: a recording folder.
        truth: track folder with the ground truth; default: RECORDING/truth; else the first filter is compared to.
        model: the body.
        out: folder to write.
        filter_: filter to run, see below. Repeatable.
        calibration: calibration file with mounts and lengths.
        start_s: exclude the first seconds, in which filters converge.
        repeats: run each N times; the shortest time counts.
        html: write compare.html.
        force: replace what is there.
    """
    import oarlock
    from oarlock.report.comparison import write_comparison

    try:
        chosen = (
            None if filter_ is None else [estimator(name) for name in dict.fromkeys(filter_) if name != ALL]
        )
    except ValueError as error:
        raise UsageError(f"--filter: {error}") from None
    place = truth_folder(recording if truth is None else truth)
    with output_folder(out, "comparison", force) as stage:
        comparison = oarlock.studies.compare(
            model.model,
            oarlock.load_recording(recording),
            None if truth is None and place == recording else oarlock.load_track(place),
            list(estimators()) if ALL in (filter_ or ()) else chosen,
            calibration=calibration,
            start_s=start_s,
            repeats=repeats,
            progress=progress,
        )
        comparison.save(stage)
        if html:
            write_comparison(comparison, stage / PAGE, f"Filters on {recording.name}")
    return comparison.to_dict() | {"out": out, "page": out / PAGE if html else None}


def _show(comparison: dict[str, Any]) -> None:
    reference = comparison["reference"]
    say(
        f"RMSE against {'truth' if reference == 'truth' else f'{reference} (no ground truth)'}, without the first "
        f"{comparison['start_s']:g} s: mean and worst of the {len(comparison['joints'])} joints\n"
        "between root and inertial units, deg; slides and positions, mm. us: processor time of the filter\n"
        "alone, for all sensors of one sample; single units need inverse kinematics beside it",
        style="dim",
    )
    say()
    wins = {name: best for name, best in comparison["wins"].items() if name != "steps_per_s"}
    heads = [
        _COLUMNS.get(name, (label(name.removesuffix("_mm").removesuffix("_rmse")), ".1f")) for name in wins
    ]
    table(
        ["filter", *(f">{head.removesuffix(' position')}" for head, _ in heads)],
        [
            (
                row["filter"],
                *(
                    number(row.get(name), style) + ("*" if row["filter"] in wins[name] else " ")
                    for name, (_, style) in zip(wins, heads, strict=True)
                ),
            )
            for row in comparison["estimators"]
        ],
    )
    say("* best, or within 2 % of the best; - no standard deviations", style="dim", indent=2)
    for name, why in comparison["left_out"].items():
        say(f"{name} was not run: {why}", style="yellow")
    say(
        f"\nWrote {comparison['out']}: compare.toml, compare.csv"
        + (f", {PAGE}" if comparison["page"] else "")
    )
    if comparison["page"]:
        steps(f"open {comparison['page']}")
