"""Trends of a season's page: a metric of one athlete by month, with 95 % band and number of sessions."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import markup, plot
from oarlock.report.plot import Floats, Panel
from oarlock.season.page.gather import Row
from oarlock.season.questions.shown import shown_metric

SIZE = (345.0, 190.0)
PLACE = (40.0, 8.0, 297.0, 128.0)
MOST_LABELS = 14
_MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]


def trend_chart(key: str, athlete: str, metric: str, rows: Sequence[Row], fact: str = "") -> str:
    """A chart; `rows` are months of the question `trend`."""
    shown = shown_metric(metric)
    x = np.array([_number(row["month"]) for row in rows], dtype=float)
    mean, low, high = (
        shown.scale * np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float)
        for name in ("mean", "low", "high")
    )
    span = (float(x.min()) - 0.5, float(x.max()) + 0.5)
    panel = Panel(*PLACE, span, plot.padded([mean, low, high], least=1e-6))
    content = _grid(panel) + _month_names(panel, x, [row["sessions"] for row in rows])
    content += _bars(panel, x, low, high) + plot.line(panel, x, mean, "series s0")
    content += "".join(
        _dot(panel, *values, shown.unit) for values in zip(x, mean, low, high, rows, strict=True)
    )
    drawn = plot.drawing(
        key, SIZE, f"{athlete}: {shown.label}", f"Mean of each month with 95 % band, {shown.unit}", content
    )
    return markup.figure(f"{athlete}: {shown.label}", drawn, unit=shown.unit, fact=fact)


def _grid(panel: Panel) -> str:
    values = plot.ticks(*panel.y_range, wanted=4)
    return "".join(
        f'<path class="grid" d="M{panel.left:g} {float(panel.y(value)):.1f}h{panel.width:g}"/>'
        + plot.label(panel.left - 5, float(panel.y(value)) + 3.5, name, anchor="end")
        for value, name in zip(values, plot.tick_labels(values), strict=True)
    )


def _month_names(panel: Panel, x: Floats, sessions: Sequence[int]) -> str:
    bottom, every = panel.top + panel.height, 1 + (len(x) - 1) // MOST_LABELS
    parts = [plot.label(panel.left - 5, bottom + 33, "n", anchor="end")]
    for k in range(0, len(x), every):
        at, month = float(panel.x(x[k])), int(x[k])
        parts.append(
            plot.label(at, bottom + 17, _MONTHS[month % 12][: 3 if len(x) <= 9 else 1], "", "middle")
        )
        parts.append(plot.label(at, bottom + 33, str(sessions[k]), "", "middle"))
    first, last = (f"{_MONTHS[int(one) % 12]} {int(one) // 12}" for one in (x[0], x[-1]))
    parts.append(plot.label(panel.left, bottom + 49, first))
    if len(x) > 1:
        parts.append(plot.label(panel.left + panel.width, bottom + 49, last, anchor="end"))
    return "".join(parts)


def _bars(panel: Panel, x: Floats, low: Floats, high: Floats) -> str:
    return "".join(
        f'<path class="interval" d="M{float(panel.x(a)):.1f} {float(panel.y(b)):.1f}V{float(panel.y(c)):.1f}"/>'
        for a, b, c in zip(x, low, high, strict=True)
        if np.isfinite(b) and np.isfinite(c)
    )


def _dot(panel: Panel, x: float, mean: float, low: float, high: float, row: Row, unit: str) -> str:
    words = f"{row['month']}: {mean:.4g} {unit} ({low:.4g} to {high:.4g}), n = {row['sessions']}"
    place = f'cx="{float(panel.x(x)):.1f}" cy="{float(panel.y(mean)):.1f}" r="2.8"'
    return f'<circle class="dot s0" {place}><title>{escape(words)}</title></circle>'


def _number(month: str) -> int:
    year, number = month.split("-")
    return 12 * int(year) + int(number) - 1
