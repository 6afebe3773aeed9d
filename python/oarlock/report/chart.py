"""The two charts of a study page: lines with bands over a number, and named intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.report import markup, plot
from oarlock.report.plot import Floats, Panel
from oarlock.report.text import number

SIZE = (400.0, 232.0)
PLACE = (46.0, 8.0, 344.0, 176.0)
LINES = 6
"""Number of series with a distinct colour and dash; the styles then repeat."""


@dataclass(frozen=True)
class Series:
    """Points (N,), optionally with a band from `low` to `high`."""

    name: str
    x: Floats
    y: Floats
    low: Floats | None = None
    high: Floats | None = None


def log_chart(series: Sequence[Series], key: str, caption: str, x_name: str, y_name: str) -> str:
    """Series on two logarithmic axes."""
    powers = [Series(s.name, np.log10(s.x), np.log10(np.where(s.y > 0, s.y, np.nan))) for s in series]
    panel = _panel(powers)
    content = _log_grid(panel) + "".join(_line(panel, s, k) for k, s in enumerate(powers))
    return _figure(
        key, caption, f"{y_name} over {x_name}, both logarithmic", content, [s.name for s in series]
    )


def line_chart(
    series: Sequence[Series], key: str, caption: str, x_name: str, y_name: str, named: bool = True
) -> str:
    """Series with bands on linear axes; the vertical axis begins at 0. Without `named` there is no legend."""
    panel = _panel(series, from_zero=True)
    content = plot.axes(panel, x_unit="", wanted=(5, 4))
    content += "".join(_band(panel, s, k) for k, s in enumerate(series))
    content += "".join(_line(panel, s, k) for k, s in enumerate(series))
    return _figure(
        key, caption, f"{y_name} over {x_name}", content, [s.name for s in series] if named else ()
    )


def _panel(series: Sequence[Series], from_zero: bool = False) -> Panel:
    across = plot.padded([s.x for s in series], least=1e-9, share=0.03)
    reach = [v for s in series for v in (s.y, s.high) if v is not None]
    up = plot.padded(reach, least=1e-9)
    return Panel(*PLACE, across, (0.0, up[1]) if from_zero else up)


def _line(panel: Panel, series: Series, k: int) -> str:
    good = np.isfinite(series.y)
    line = plot.line(panel, series.x[good], series.y[good], f"series s{k % LINES}")
    dots = "".join(
        f'<circle class="dot s{k % LINES}" cx="{float(panel.x(x)):.1f}" cy="{float(panel.y(y)):.1f}" r="2.6"/>'
        for x, y in zip(series.x[good], series.y[good], strict=True)
    )
    return line + dots


def _band(panel: Panel, series: Series, k: int) -> str:
    if series.low is None or series.high is None:
        return ""
    low = np.maximum(series.low, panel.y_range[0])
    high = np.minimum(series.high, panel.y_range[1])
    return plot.band(panel, series.x, low, high, f"series-band s{k % LINES}")


def _log_grid(panel: Panel) -> str:
    parts = []
    for values, across in ((_decades(*panel.x_range), True), (_decades(*panel.y_range), False)):
        for value in values:
            name = f"{round(10.0**value, 6):g}"
            if across:
                x, bottom = float(panel.x(value)), panel.top + panel.height
                parts.append(f'<path class="tick" d="M{x:.1f} {bottom:.1f}v3"/>')
                parts.append(plot.label(x, bottom + 14, name, anchor="middle"))
            else:
                y = float(panel.y(value))
                parts.append(f'<path class="grid" d="M{panel.left:.1f} {y:.1f}h{panel.width:.1f}"/>')
                parts.append(plot.label(panel.left - 5, y + 3.5, name, anchor="end"))
    return "".join(parts)


def _decades(low: float, high: float) -> list[float]:
    """1, 2 and 5 times powers of ten inside a range of logarithms, at most eight."""
    found = [
        math.log10(m) + k
        for k in range(math.floor(low), math.ceil(high) + 1)
        for m in (1, 2, 5)
        if low <= math.log10(m) + k <= high
    ]
    return found if len(found) <= 8 else [value for value in found if abs(value - round(value)) < 1e-9]


def _figure(key: str, caption: str, description: str, content: str, names: Sequence[str]) -> str:
    svg = plot.drawing(key, SIZE, caption, description, content)
    keys = [(f'<path class="series s{k % LINES}" d="M0 6H28"/>', name) for k, name in enumerate(names)]
    below = markup.legend(keys) if len(keys) > 1 else ""
    return markup.figure(caption, svg, unit=description, key=f"{key}-figure", below=below)


def interval_chart(rows: Sequence[tuple[str, float, float, float]], key: str, caption: str, unit: str) -> str:
    """One row per name with a mean and an interval; an interval may be missing (NaN)."""
    height = 20.0
    left, top, width = 4.0, 6.0, 392.0
    ends = np.array([value for _, *values in rows for value in values if math.isfinite(value)])
    most = 1.05 * float(ends.max()) if len(ends) and ends.max() > 0 else 1.0
    step = height + 16.0
    panel = Panel(left, top, width, step * len(rows), (0.0, most), (0.0, 1.0))
    parts = [_vertical_grid(panel)]
    for k, (name, mean, low, high) in enumerate(rows):
        y = top + step * k + 26.0
        parts.append(plot.label(left, y - 10.0, name, "strip-name"))
        if not math.isfinite(mean):
            parts.append(plot.label(left + width, y - 10.0, "failed", "failed", "end"))
            continue
        parts.append(plot.label(left + width, y - 10.0, f"{number(mean)} {unit}", "", "end"))
        if math.isfinite(low) and math.isfinite(high):
            a, b = float(panel.x(max(low, 0.0))), float(panel.x(min(high, most)))
            parts.append(f'<path class="interval" d="M{a:.1f} {y:.1f}H{b:.1f}"/>')
        parts.append(f'<circle class="dot s0" cx="{float(panel.x(mean)):.1f}" cy="{y:.1f}" r="3.6"/>')
    size = (400.0, top + step * len(rows) + 26.0)
    svg = plot.drawing(key, size, caption, f"Mean and 95 % interval, {unit}", "".join(parts))
    return markup.figure(caption, svg, unit=unit, key=f"{key}-figure")


def _vertical_grid(panel: Panel) -> str:
    values = plot.ticks(*panel.x_range, wanted=4)
    bottom = panel.top + panel.height
    parts = [
        f'<path class="grid" d="M{float(panel.x(v)):.1f} {panel.top:.1f}V{bottom:.1f}"/>' for v in values
    ]
    names = zip(values, plot.tick_labels(values), strict=True)
    parts += [
        plot.label(float(panel.x(v)), bottom + 14, name, anchor="middle" if v else "start")
        for v, name in names
    ]
    return "".join(parts)
