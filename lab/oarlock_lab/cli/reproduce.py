"""`oarlock lab reproduce`: repeats the paper's tables and figures and compares them with the printed values."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Force, Jobs, Json, OutFolder, example
from oarlock.cli.terminal import (
    UsageError,
    continuing_verb,
    heading,
    output_folder,
    print_json,
    progress,
    say,
    steps,
    table,
)

if TYPE_CHECKING:
    from oarlock_lab.reproduce.contents import PaperPart

RUN_FILE = "run.toml"
PAIRS, WIDEST = 5, 6
LEAD = (
    "Ruffaldi, Peppoloni and Filippeschi, Sensor fusion for complex articulated body tracking applied in rowing, "
    "J. Sports Engineering and Technology: its experiments repeated, with the printed values.",
)


class What(StrEnum):
    """Experiments that can be repeated."""

    table5 = "table5"
    table6 = "table6"
    fig3 = "fig3"
    fig4 = "fig4"
    fig5 = "fig5"
    discussion = "discussion"
    cost = "cost"
    all = "all"


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "reproduce",
        epilog=example(
            "oarlock lab reproduce table5 --out table5",
            "oarlock lab reproduce all --out paper",
            "oarlock lab reproduce fig3 --seed 7 --out fig3",
            "oarlock lab reproduce table5 --seeds 10 --seed 100 --json --out table5 | jq .table5.met",
        ),
    )(reproduce)


@continuing_verb
def reproduce(
    what: Annotated[
        list[What],
        typer.Argument(metavar="WHAT", help="table5, table6, fig3 to fig5, discussion, cost, all."),
    ],
    out: OutFolder,
    seeds: Annotated[
        int | None,
        typer.Option("--seeds", metavar="N", min=1, help="Number of seeds; default 3, or 1 with --seed."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", metavar="N", min=0, help="First seed; default 0.")
    ] = None,
    duration_s: Annotated[
        float, typer.Option("--duration-s", metavar="S", min=4.0, help="Length of each recording.")
    ] = 40.0,
    jobs: Jobs = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Make parts again that are in FOLDER already, by the same version.")
    ] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Repeat experiments of the paper: write a report that compares the values, and the tables.

    Finished parts are kept in FOLDER/parts: after Ctrl-C the same command continues from there.
    """
    from oarlock_lab.reproduce.part_cache import FOLDER, PartCache
    from oarlock_lab.reproduce.reproduce import PARTS
    from oarlock_lab.reproduce.reproduce import reproduce as run

    chosen = PARTS if What.all in what else tuple(part.value for part in what)
    if len(set(chosen)) < len(chosen):
        raise UsageError(f"{', '.join(chosen)}: one of them is named twice")
    count = seeds if seeds is not None else (3 if seed is None else 1)
    numbers = tuple(range(seed or 0, (seed or 0) + count))
    kept, skipped = PartCache(out / FOLDER, numbers, duration_s), []
    with output_folder(out, "reproduction", force, beside=FOLDER) as stage:
        for key in chosen if anew else ():
            kept.forget(key)
        with progress("running the paper's experiments") as told:
            parts = run(
                *(chosen, numbers),
                duration_s=duration_s,
                jobs=jobs,
                progress=told,
                kept=kept,
                on_part=lambda key, is_kept: skipped.append(key) if is_kept else None,
            )
        report = out / write_reproduction(parts, stage, numbers, duration_s).name
    if json_output:
        print_json(_document(parts, report))
        return
    for part in parts:
        _write(part)
    if skipped:
        say(f"\nKept from before: {', '.join(skipped)}; --anew makes them again")
    say(f"\nWrote {out}: report.html, and its tables as CSV and Parquet")
    steps(f"open {report}")


def write_reproduction(parts: list[PaperPart], out: Path, seeds: tuple[int, ...], duration_s: float) -> Path:
    """Write the page, the tables and run.toml; return the path of the page."""
    from oarlock import __version__
    from oarlock.evaluation.study.rows import write_rows
    from oarlock.storage.toml import write_toml
    from oarlock.storage.write_file import write_file
    from oarlock_lab.reproduce.page import reproduction_page

    for part in parts:
        for name, rows in part.data.items():
            write_rows(rows, out / name)
    title = parts[0].title if len(parts) == 1 else "Reproduction of the paper"
    report = out / "report.html"
    write_file(report, reproduction_page(parts, title, LEAD))
    description: dict[str, object] = {
        "format": 1,
        "oarlock": __version__,
        "parts": [part.key for part in parts],
        "seeds": list(seeds),
        "duration_s": duration_s,
    }
    write_toml(out / RUN_FILE, description)
    return report


def _write(part: PaperPart) -> None:
    heading(part.title)
    for shown in part.tables:
        if shown.closed:
            continue
        say(f"\n{shown.caption}", style="dim", indent=2)
        # A terminal has 100 columns; the page contains the remaining columns.
        kept = PAIRS if shown.rows[0][-1].paper else WIDEST
        rows = [[_cell(cell.ours, cell.paper, cell.mark) for cell in row[:kept]] for row in shown.rows]
        first, *others = shown.head[:kept]
        table([first, *(f">{name}" for name in others)], rows)
    if part.claims:
        table(["verdict", "claim"], [(claim.verdict, claim.sentence) for claim in part.claims])
    if not part.tables and not part.claims:
        for text in part.lead:
            say(text, indent=2)


def _cell(ours: str, paper: str, mark: str) -> str:
    beside = f" | {paper}" if paper else ""
    sign = {"met": " ✓", "missed": " ✗"}.get(mark, "") if ours != mark else ""
    return f"{ours}{beside}{sign}"


def _document(parts: list[PaperPart], report: Path) -> dict[str, object]:
    document: dict[str, object] = {"report": report}
    for part in parts:
        met, bounds = part.marks
        document[part.key] = {
            "met": met,
            "bounds": bounds,
            "tables": {shown.key: {"head": shown.head, "rows": shown.rows} for shown in part.tables},
            "claims": part.claims,
            "notes": part.notes,
        }
    return document
