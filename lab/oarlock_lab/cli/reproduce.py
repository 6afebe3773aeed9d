"""`oarlock lab reproduce`: repeats the paper's tables and figures and compares them with the printed values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, heading, output_folder, progress, say, steps, table
from oarlock.cli.verbs import command
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock_lab.reproduce.contents import PaperPart

RUN_FILE = "run.toml"
PAIRS, WIDEST = 5, 6
LEAD = (
    "Ruffaldi, Peppoloni and Filippeschi, Sensor fusion for complex articulated body tracking applied in rowing, "
    "J. Sports Engineering and Technology: its experiments repeated, with the printed values.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock lab reproduce table5 --out table5",
        "oarlock lab reproduce all --out paper",
        "oarlock lab reproduce fig3 --seed 7 --out fig3",
        "oarlock lab reproduce table5 --seeds 10 --seed 100 --json --out table5 | jq .table5.met",
        show=_show,
        continues=True,
        metavars={"what": "WHAT", "out": "FOLDER"},
        bounds={"seeds": (1, None), "seed": (0, None), "duration_s": (4.0, None)},
    )(reproduce)


@dataclass(frozen=True)
class Reproduction:
    """Reproduced parts, those of them that an earlier run made, and the page."""

    parts: list[PaperPart]
    earlier: list[str]
    report: Path

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        document: dict[str, Any] = {"report": self.report, "earlier": self.earlier}
        for part in self.parts:
            met, bounds = part.marks
            document[part.key] = {
                "met": met,
                "bounds": bounds,
                "tables": {
                    part_table.key: {"head": part_table.head, "rows": part_table.rows}
                    for part_table in part.tables
                },
                "claims": part.claims,
                "notes": part.notes,
            }
        return document


def reproduce(
    names: list[str],
    *,
    out: Path,
    seeds: int | None = None,
    seed: int | None = None,
    duration_s: float = 40.0,
    jobs: int | None = None,
    anew: bool = False,
    force: bool,
) -> Reproduction:
    """Repeat experiments of the paper: write a report that compares the values, and the tables.

    Finished parts are kept in FOLDER/parts: after Ctrl-C the same command continues from there.

    Args:
        names: table5, table6, fig3 to fig5, discussion, cost, all.
        out: folder to write.
        seeds: number of seeds; default 3, or 1 with --seed.
        seed: first seed; default 0.
        duration_s: length of each recording.
        jobs: parallel processes; default: all cores.
        anew: make parts again that are in FOLDER already, by the same version.
        force: replace what is there.
    """
    from oarlock_lab.reproduce.part_cache import FOLDER, PartCache
    from oarlock_lab.reproduce.reproduce import PARTS
    from oarlock_lab.reproduce.reproduce import reproduce as run

    for name in names:
        if name not in (*PARTS, "all"):
            raise UsageError(f"{name}: the paper has no such part. {did_you_mean(name, (*PARTS, 'all'))}")
    selected = [part for part in PARTS if part in names or "all" in names]
    count = seeds if seeds is not None else (3 if seed is None else 1)
    numbers = tuple(range(seed or 0, (seed or 0) + count))
    cache, earlier = PartCache(out / FOLDER, numbers, duration_s), list[str]()
    with output_folder(out, "reproduction", force, beside=FOLDER) as stage:
        for key in selected if anew else ():
            cache.forget(key)
        with progress("running the paper's experiments") as share:
            parts = run(
                *(selected, numbers),
                duration_s=duration_s,
                jobs=jobs,
                progress=share,
                cache=cache,
                on_part=lambda key, is_earlier: earlier.append(key) if is_earlier else None,
            )
        report = out / write_reproduction(parts, stage, numbers, duration_s).name
    return Reproduction(parts, earlier, report)


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


def _show(reproduction: Reproduction) -> None:
    for part in reproduction.parts:
        heading(part.title)
        for part_table in part.tables:
            if not part_table.closed:
                say(f"\n{part_table.caption}", style="dim", indent=2)
                # A terminal has 100 columns; the page contains the remaining columns.
                width = PAIRS if part_table.rows[0][-1].paper else WIDEST
                first, *others = part_table.head[:width]
                rows = [
                    [_cell(cell.ours, cell.paper, cell.mark) for cell in row[:width]]
                    for row in part_table.rows
                ]
                table([first, *(f">{name}" for name in others)], rows)
        if part.claims:
            table(["verdict", "claim"], [(claim.verdict, claim.sentence) for claim in part.claims])
        if not part.tables and not part.claims:
            for text in part.lead:
                say(text, indent=2)
    if reproduction.earlier:
        say(f"\nKept from before: {', '.join(reproduction.earlier)}; --anew makes them again")
    say(f"\nWrote {reproduction.report.parent}: report.html, and its tables as CSV and Parquet")
    steps(f"open {reproduction.report}")


def _cell(ours: str, paper: str, mark: str) -> str:
    printed = f" | {paper}" if paper else ""
    sign = {"met": " ✓", "missed": " ✗"}.get(mark, "") if ours != mark else ""
    return f"{ours}{printed}{sign}"
