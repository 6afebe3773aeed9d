"""One page and one file of figures from the results of all data sets."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from .plots import svg
from .results import Cell, Plot, SetResult, Table

STYLE = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")

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
    document = {"versions": dict(versions), "sets": {r.name: _plain(r) for r in results}}
    figures.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return page, figures


def html(results: Sequence[SetResult], versions: Mapping[str, str]) -> str:
    """The whole page; nothing in it comes from elsewhere."""
    used = ", ".join(f"{name} {v}" for name, v in versions.items())
    links = " · ".join(f'<a href="#{r.name}">{escape(r.title)}</a>' for r in results)
    body = "\n".join(_section(r) for r in results)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Oarlock on public recordings</title><style>\n{STYLE}</style></head>\n<body>"
        f"<h1>Oarlock on public recordings</h1>\n<p>{escape(INTRODUCTION)}</p>\n"
        f'<p class="fine">Compared: {escape(used)}.</p>\n<nav>{links}</nav>\n{body}\n</body></html>\n'
    )


def _section(result: SetResult) -> str:
    parts = [f'<section id="{result.name}"><h2>{escape(result.title)}</h2>', f"<p>{escape(result.text)}</p>"]
    if result.absent:
        parts.append(f'<p class="absent">Not run: {escape(result.absent)}</p>')
    parts += [_table(t) for t in result.tables]
    parts += [f'<p class="fine">{escape(note)}</p>' for note in result.notes]
    parts += [_figure(p) for p in result.plots]
    return "\n".join([*parts, "</section>"])


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col">{escape(c)}</th>' for c in table.columns)
    rows = []
    best = _best(table)
    for row in table.rows:
        cells = "".join(
            f'<td class="best">{_text(c, table.digits)}</td>'
            if (row.name, i) in best
            else f"<td>{_text(c, table.digits)}</td>"
            for i, c in enumerate(row.cells)
        )
        note = f'<td class="note">{escape(row.note)}</td>'
        kind = ' class="ours"' if row.ours else ""
        rows.append(f'<tr{kind}><th scope="row">{escape(row.name)}</th>{cells}{note}</tr>')
    unit = f" ({table.unit})" if table.unit else ""
    text = f"<p>{escape(table.text)}</p>" if table.text else ""
    return (
        f"<h3>{escape(table.title)}{escape(unit)}</h3>{text}\n<table><thead><tr><th></th>{head}<th></th></tr></thead>\n"
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _best(table: Table) -> set[tuple[str, int]]:
    """The smallest figure of each column, where a column compares software."""
    if not table.unit:
        return set()
    found = set()
    for i in range(len(table.columns)):
        numbers = {r.name: c for r in table.rows if isinstance(c := r.cells[i], float) and math.isfinite(c)}
        if len(numbers) > 1:
            found.add((min(numbers, key=lambda name: numbers[name]), i))
    return found


def _text(cell: Cell, digits: int) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return "–"
    return f"{cell:.{digits}f}" if isinstance(cell, float) else escape(str(cell))


def _figure(plot: Plot) -> str:
    try:
        drawn = svg(plot)
    except ImportError:
        drawn = '<p class="absent">Plots need matplotlib.</p>'
    return f"<figure>{drawn}<figcaption>{escape(plot.title)}</figcaption></figure>"


def _plain(result: SetResult) -> dict[str, object]:
    """The figures without the curves; what is no number is null."""
    tables = [
        {
            "title": t.title,
            "unit": t.unit,
            "rows": {
                r.name: {"note": r.note, "ours": r.ours}
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
