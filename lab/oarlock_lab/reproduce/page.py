"""The page of a reproduction: each part of the paper with its printed values and ours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from oarlock.evaluation.interval import Interval
from oarlock.report import chart, curves
from oarlock.report.markup import grid, rendered
from oarlock.report.page import shell
from oarlock.report.section import KeyFigure, tiles
from oarlock_lab.reproduce.contents import Chart, EstimateCurve, PaperPart

_VERDICT_STYLES = {"holds": "good", "holds in part": "partly", "does not hold": "bad", "not checked": "open"}
_DETAIL_S = 3.0


def reproduction_page(parts: Sequence[PaperPart], title: str, lead: Sequence[str]) -> str:
    """The whole page as text; works offline, on paper and on a telephone."""
    head = "".join(f"<p>{escape(text)}</p>" for text in lead)
    sections = [(part.key, part.title, _part(part)) for part in parts]
    return shell(
        title, f'<div class="lead">{head}</div>{_figures(parts)}', sections, curves.clip_definition()
    )


def _figures(parts: Sequence[PaperPart]) -> str:
    """Key figures of the parts that have bounds or verdicts."""
    figures = []
    for part in parts:
        name, (met, bounds) = part.title.partition(":")[0], part.marks
        if bounds:
            figures.append(KeyFigure(name, f"{met} of {bounds}", "bounds met"))
        if part.claims:
            confirmed = sum(claim.verdict == "holds" for claim in part.claims)
            figures.append(KeyFigure(name, f"{confirmed} of {len(part.claims)}", "claims hold"))
    return tiles(figures) if figures else ""


def _part(part: PaperPart) -> str:
    charts = "".join(chart.log_chart(_series(c), c.key, c.caption, c.x_name, c.y_name) for c in part.charts)
    return rendered(
        "reproduction_part",
        part=part,
        verdict_styles=_VERDICT_STYLES,
        curves=_curves(part.key, part.curves),
        charts=charts,
    )


def _series(drawn: Chart) -> list[chart.Series]:
    return [chart.Series(name, x, y) for name, (x, y) in drawn.series.items()]


def _curves(key: str, groups: Mapping[str, tuple[EstimateCurve, ...]]) -> str:
    content: list[str] = []
    for name, figure in groups.items():
        window = _window(figure[0])
        legend = curves.legend("truth", window) if not content else ""
        drawn = grid((_figure(key, curve, window) for curve in figure), "tall")
        content.append(f"{legend}<h3>{escape(name.replace('_', ' '))}</h3>{drawn}")
    return "".join(content)


def _window(curve: EstimateCurve) -> Interval:
    middle = 0.5 * float(curve.time_s[0] + curve.time_s[-1])
    half = 0.5 * min(_DETAIL_S, float(curve.time_s[-1] - curve.time_s[0]))
    return Interval(middle - half, middle + half)


def _figure(key: str, curve: EstimateCurve, window: Interval) -> str:
    drawn = curves.ErrorCurve(
        curve.name,
        curve.unit,
        curve.time_s,
        curve.value,
        curve.half_band,
        curve.value - curve.truth,
        np.ones(len(curve.time_s), dtype=bool),
    )
    own = re.sub(r"[^a-z0-9]+", "-", f"{key}-{curve.name}".lower())
    return curves.figure(own, drawn, window, escape(curve.note))
