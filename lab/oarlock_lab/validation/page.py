"""One page and one file of figures from the results of all data sets."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from .plots import svg
from .results import Cell, Plot, ResultTable, SetResult

HERE = Path(__file__).parent
STYLE = (HERE / "page.css").read_text(encoding="utf-8")

INTRODUCTION = (
    "Public recordings, tracked by Oarlock and by other software in the same run, with the same rules for "
    "all. Oarlock's lines stand first and are marked. Other software runs with its default settings "
    "unless a line says otherwise. Figures are in degrees and smaller is better, unless a table says "
    "otherwise. What the rules are and where the data come from stands in docs/validation.md."
)


def write(results: Sequence[SetResult], versions: Mapping[str, str], folder: Path) -> tuple[Path, Path]:
    """Write `index.html` and `figures.json` into a folder; gives both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    page, figures = folder / "index.html", folder / "figures.json"
    page.write_text(html(results, versions), encoding="utf-8")
    text = json.dumps(document(results, versions), indent=1, allow_nan=False)
    figures.write_text(text + "\n", encoding="utf-8")
    return page, figures


def document(results: Sequence[SetResult], versions: Mapping[str, str]) -> dict[str, Any]:
    """All figures without the curves."""
    return {"versions": dict(versions), "sets": {r.name: _plain(r) for r in results}}


def html(results: Sequence[SetResult], versions: Mapping[str, str]) -> str:
    """The whole page; nothing in it comes from elsewhere."""
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"best": _best, "shown": _cell_text, "drawn": _drawn}
    page = environment.get_template("page.html.j2")
    return page.render(results=results, versions=versions, style=STYLE, introduction=INTRODUCTION) + "\n"


def _best(table: ResultTable) -> set[tuple[str, int]]:
    """The smallest figure of each column, where a column compares software."""
    if not table.unit:
        return set()
    best = set()
    for i in range(len(table.columns)):
        numbers = {r.name: c for r in table.rows if isinstance(c := r.cells[i], float) and math.isfinite(c)}
        if len(numbers) > 1:
            best.add((min(numbers, key=lambda name: numbers[name]), i))
    return best


def _cell_text(cell: Cell, digits: int) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return "–"
    return f"{cell:.{digits}f}" if isinstance(cell, float) else str(cell)


def _drawn(plot: Plot) -> str:
    try:
        return svg(plot)
    except ImportError:
        return '<p class="absent">Plots need matplotlib.</p>'


def _plain(result: SetResult) -> dict[str, object]:
    """The figures without the curves; what is no number is null."""
    tables = [
        {
            "title": t.title,
            "unit": t.unit,
            "rows": {
                r.name: {"note": r.note, "ours": r.ours, "online": r.online}
                | {
                    column: (None if isinstance(c, float) and not math.isfinite(c) else c)
                    for column, c in zip(t.columns, r.cells, strict=True)
                }
                for r in t.rows
            },
        }
        for t in result.tables
    ]
    return {"title": result.title, "absent": result.absent, "notes": list(result.notes), "tables": tables}
