"""The page of a reproduction: each part of the paper with its printed values and ours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from oarlock.evaluation.tracklike import Interval
from oarlock.lab.reproduce.contents import Cell, Chart, Claim, Curve, Part, Table
from oarlock.report import chart, curves
from oarlock.report.page import shell
from oarlock.report.text import breakable

_VERDICT_STYLES = {"holds": "good", "holds in part": "partly", "does not hold": "bad", "not checked": "open"}
_DETAIL_S = 3.0


def reproduction_page(parts: Sequence[Part], title: str, lead: Sequence[str]) -> str:
    """The whole page as text; works offline, on paper and on a telephone."""
    head = "".join(f"<p>{escape(text)}</p>" for text in lead)
    sections = [(part.key, part.title, _part(part)) for part in parts]
    return shell(
        title, f'<div class="lead">{head}</div>{_figures(parts)}', sections, curves.clip_definition()
    )


def _figures(parts: Sequence[Part]) -> str:
    """Key figures of the parts that have bounds or verdicts."""
    found = []
    for part in parts:
        met, bounds = part.marks
        if bounds:
            found.append((part.title.partition(":")[0], f"{met} of {bounds}", "bounds met"))
        if part.claims:
            held = sum(claim.verdict == "holds" for claim in part.claims)
            found.append((part.title.partition(":")[0], f"{held} of {len(part.claims)}", "claims hold"))
    cards = "".join(
        f"<div><dt>{escape(name)}</dt><dd><b>{value}</b><span>{what}</span></dd></div>"
        for name, value, what in found
    )
    return f'<dl class="figures">{cards}</dl>' if cards else ""


def _part(part: Part) -> str:
    lead = "".join(f"<p>{escape(text)}</p>" for text in part.lead)
    content = [f'<div class="prose">{lead}</div>']
    content += [_claims(part.claims)] if part.claims else []
    content += [_table(shown) for shown in part.tables]
    content += [_curves(part.key, part.curves)] if part.curves else []
    if part.charts:
        drawn = "".join(
            chart.log_chart(_series(c), c.key, c.caption, c.x_name, c.y_name) for c in part.charts
        )
        content.append(f'<div class="grid-figures">{drawn}</div>')
    if part.notes:
        notes = "".join(f"<li>{escape(note)}</li>" for note in part.notes)
        content.append(f'<h3>Footnotes</h3><ol class="notes">{notes}</ol>')
    if part.data:
        files = ", ".join(f"<code>{escape(name)}</code>" for name in part.data)
        content.append(f'<p class="hint">Tables beside this page, as CSV and Parquet: {files}.</p>')
    return "".join(content)


def _series(shown: Chart) -> list[chart.Series]:
    return [chart.Series(name, x, y) for name, (x, y) in shown.series.items()]


def _table(shown: Table) -> str:
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in shown.head)
    body = "".join(f"<tr>{''.join(_cell(c, k == 0) for k, c in enumerate(row))}</tr>" for row in shown.rows)
    caption = f'<caption id="{shown.key}-caption"><span>{escape(shown.caption)}</span></caption>'
    table = (
        f'<div class="scroll" tabindex="0" role="region" aria-labelledby="{shown.key}-caption">'
        f'<table id="{shown.key}-table" class="compared">{"" if shown.closed else caption}'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
    if not shown.closed:
        return table
    return f'<details><summary id="{shown.key}-caption">{escape(shown.caption)}</summary>{table}</details>'


def _cell(cell: Cell, first: bool) -> str:
    if first:
        return f'<th scope="row">{breakable(cell.ours)}</th>'
    inside = f"<b>{escape(cell.ours)}</b>" if cell.paper else escape(cell.ours)
    inside += f' <span class="spread">{escape(cell.spread)}</span>' if cell.spread else ""
    inside += f'<span class="printed">paper {escape(cell.paper)}</span>' if cell.paper else ""
    if cell.bound:
        sign = "✓" if cell.mark == "met" else "✗"
        inside += f'<span class="printed {cell.mark}">{sign} {escape(cell.bound)} {cell.mark}</span>'
    return f'<td class="{cell.mark}">{inside}</td>'


def _claims(claims: Sequence[Claim]) -> str:
    shown = "".join(
        f'<article class="claim"><p class="verdict {_VERDICT_STYLES[claim.verdict]}">{claim.verdict}</p>'
        f"<blockquote><p>{escape(claim.sentence)}</p><footer>{escape(claim.source)}</footer></blockquote>"
        f'<p>{escape(claim.found)}</p><p class="hint">{escape(claim.done)}</p></article>'
        for claim in claims
    )
    return f'<div class="claims">{shown}</div>'


def _curves(key: str, groups: Mapping[str, tuple[Curve, ...]]) -> str:
    content: list[str] = []
    for name, shown in groups.items():
        window = _window(shown[0])
        legend = curves.legend("truth", window) if not content else ""
        drawn = "".join(_figure(key, curve, window) for curve in shown)
        content.append(
            f'{legend}<h3>{escape(name.replace("_", " "))}</h3><div class="grid-figures tall">{drawn}</div>'
        )
    return "".join(content)


def _window(curve: Curve) -> Interval:
    middle = 0.5 * float(curve.time_s[0] + curve.time_s[-1])
    half = 0.5 * min(_DETAIL_S, float(curve.time_s[-1] - curve.time_s[0]))
    return Interval(middle - half, middle + half)


def _figure(key: str, curve: Curve, window: Interval) -> str:
    drawn = curves.Curve(
        curve.name,
        curve.unit,
        curve.factor,
        curve.time_s,
        curve.value,
        curve.half_band,
        curve.value - curve.truth,
        np.ones(len(curve.time_s), dtype=bool),
    )
    own = re.sub(r"[^a-z0-9]+", "-", f"{key}-{curve.name}".lower())
    return curves.figure(own, drawn, window, f'<span class="fact">{escape(curve.remark)}</span>')
