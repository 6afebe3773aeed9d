"""The charts of a fault study as one SVG file, for pages that show only pictures."""

from __future__ import annotations

from html import escape

import numpy as np

from oarlock.evaluation.study.costs import doses
from oarlock.evaluation.study.result import StudyResult
from oarlock.report import fault_charts as charts
from oarlock.report import plot
from oarlock.report.fault_page import by_fault

COLUMNS = 4
TILE = (252.0, 214.0)
INSIDE = (36.0, 26.0, 208.0, 100.0)
MARGIN, HEAD = 10.0, 30.0
LETTER, SIGN = 5.6, 58.0
"""Approximate width of a letter of the legend, and of a symbol with its margin."""

_STYLE = """
text { font: 10.5px system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; fill: #4a5562; }
.strip-name { font-weight: 650; font-size: 12px; fill: #16202b; }
.grid { stroke: #dde2e8; fill: none; } .tick { stroke: #566270; }
.clean { stroke: #566270; stroke-dasharray: 2 3; fill: none; }
.series { fill: none; stroke-width: 1.4; stroke-linejoin: round; } .series.s0 { stroke-width: 2.2; }
.series-band { fill-opacity: .18; } .seeds { stroke: #0072b2; stroke-width: 6; stroke-opacity: .25; }
.cross { fill: none; stroke-width: 1.8; }
.small { font-size: 9px; }
"""
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
_DASHES = ("", "8 2", "4 2", "9 2 2 2")


def fault_picture(result: StudyResult) -> str:
    """All faults from weak to strong, the most harmful first, as an SVG file on white."""
    clean, curves = by_fault(result)
    scale = charts.Scale(doses(result.study, result.rows))
    rows = -(-len(curves) // COLUMNS)
    size = (2 * MARGIN + COLUMNS * TILE[0], MARGIN + HEAD + rows * TILE[1])
    parts = [_legend(list(clean))]
    for k, by_setting in enumerate(curves.values()):
        own = next(iter(by_setting.values()))
        fault = own[0].fault
        if fault is None:
            continue
        x, y = MARGIN + (k % COLUMNS) * TILE[0], HEAD + (k // COLUMNS) * TILE[1]
        inside = charts.panel_of(fault, by_setting, scale, INSIDE)
        name = plot.label(INSIDE[0], 16.0, fault.name, "strip-name")
        parts.append(f'<g transform="translate({x:g} {y:g})">{name}{inside}</g>')
    title = escape(f"{result.study.title}: error of the angles in deg against the strength of each fault")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]:g} {size[1]:g}" width="{size[0]:g}" '
        f'height="{size[1]:g}" role="img"><title>{title}</title><style>{_STYLE}{_colours()}</style>'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


def _colours() -> str:
    return "".join(
        f".series.s{k}, .cross.s{k} {{ stroke: {colour}; }} .dot.s{k}, .series-band.s{k} {{ fill: {colour}; }} "
        + (f".series.s{k} {{ stroke-dasharray: {dash}; }} " if dash else "")
        for k, (colour, dash) in enumerate(zip(_COLOURS, _DASHES, strict=True))
    )


def _legend(settings: list[str]) -> str:
    entries = [
        (f'<path class="series s{k}" d="M0 0H28"/>{charts.symbol(14, 0, k)}', name)
        for k, name in enumerate(settings)
    ]
    entries.append(('<rect class="series-band s0" y="-6" width="28" height="12"/>', "range over the seeds"))
    entries.append(('<path class="clean" d="M0 0H28"/>', "without a fault"))
    entries.append(
        (f'<path class="cross s0" transform="translate(14 0)" d="{charts.CROSS}"/>', "a seed was lost")
    )
    places = np.cumsum([MARGIN, *(LETTER * len(name) + SIGN for _, name in entries[:-1])])
    return "".join(
        f'<g transform="translate({x:.1f} 16)">{drawn}{plot.label(34.0, 4.0, name)}</g>'
        for x, (drawn, name) in zip(places, entries, strict=True)
    )
