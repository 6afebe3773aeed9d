"""Charts of pages: curves with bands, paths in a plane, values with intervals; for sections of fields and studies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.report import markup, plot
from oarlock.report.plot import Panel
from oarlock.report.text import number
from oarlock.storage.arrays import Floats

WIDTH, HEIGHT = 400.0, 214.0
PLACE = (40.0, 14.0, 354.0, 160.0)
TALLEST = 250.0
STUDY_SIZE, STUDY_PLACE = (400.0, 232.0), (46.0, 8.0, 344.0, 176.0)
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


@dataclass(frozen=True)
class Mark:
    """A line across a drawing at `value` of its horizontal axis, with a short name above it."""

    value: float
    name: str


@dataclass(frozen=True)
class Zone:
    """A named range of a vertical axis, such as a published range."""

    low: float
    high: float
    name: str


@dataclass(frozen=True)
class Axis:
    """The quantity of an axis, its unit, an optional fixed range, and the smallest range."""

    name: str
    unit: str
    span: tuple[float, float] | None = None
    least: float = 1e-6

    @property
    def in_words(self) -> str:
        """Name and unit."""
        return ", ".join(part for part in (self.name, self.unit) if part)


def course_chart(
    key: str,
    caption: str,
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    marks: Sequence[Mark] = (),
) -> str:
    """Series with bands over one axis, with marks behind them. A single series has no legend."""
    reach = [v for s in series for v in (s.y, s.low, s.high) if v is not None]
    across = x.span or _extent([s.x for s in series])
    panel = Panel(*PLACE, across, plot.padded(reach, least=y.least))
    content = "".join(
        [
            plot.axes(panel, x_unit=x.unit, wanted=(5, 4)),
            plot.level(panel, 0.0, "zero") if panel.y_range[0] < 0 < panel.y_range[1] else "",
            "".join(_mark(panel, mark) for mark in marks),
            "".join(_band(panel, s, k) for k, s in enumerate(series)),
            "".join(plot.line(panel, s.x, s.y, f"series s{k % LINES}") for k, s in enumerate(series)),
            _axis_name(panel, x),
        ]
    )
    words = f"{y.in_words or caption} over {x.in_words}. {_ends(series, y.unit)}"
    svg = plot.drawing(f"{key}-svg", (WIDTH, HEIGHT), caption, words, content)
    return _figure(key, caption, y.in_words, svg, [s.name for s in series])


def plane_chart(
    key: str,
    caption: str,
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    points: Sequence[tuple[float, float, str]] = (),
    faint: Sequence[Series] = (),
    taller: float = 1.0,
) -> str:
    """Paths in a plane, with named points; a path's band is that of its `low` and `high` in y.

    `faint` paths are drawn behind, thin and without names. The scale of y is `taller` times that of x.
    """
    shown = [*series, *faint]
    across = x.span or plot.padded([s.x for s in shown], least=0.02)
    up = y.span or plot.padded([v for s in shown for v in (s.y, s.low, s.high) if v is not None], least=0.02)
    left, top, width, _ = PLACE
    height = min(max(taller * width * (up[1] - up[0]) / (across[1] - across[0]), 70.0), TALLEST)
    panel = Panel(
        left,
        top,
        width,
        height,
        _widened(across, taller * width / height * (up[1] - up[0])),
        _widened(up, height / width * (across[1] - across[0]) / taller),
    )
    parts = [plot.axes(panel, x_unit=x.unit, wanted=(5, 3))]
    parts += [plot.line(panel, s.x, s.y, "faint") for s in faint]
    for k, s in enumerate(series):
        parts.append(_band(panel, s, k))
        parts.append(plot.line(panel, s.x, s.y, f"series s{k % LINES}"))
    for k, (px, py, name) in enumerate(points):
        place = f'cx="{float(panel.x(px)):.1f}" cy="{float(panel.y(py)):.1f}"'
        parts.append(f'<circle class="place" {place} r="3"/>')
        parts.append(
            plot.label(
                float(panel.x(px)), float(panel.y(py)) + (-7 if k % 2 == 0 else 15), name, "halo", "middle"
            )
        )
    parts.append(_axis_name(panel, x))
    scales = "equal scales" if taller == 1.0 else f"{y.name} drawn {taller:g} times as large"
    words = f"{y.in_words or caption} over {x.in_words}, {scales}. {_ends(series, y.unit)}"
    svg = plot.drawing(f"{key}-svg", (WIDTH, top + height + 44.0), caption, words, "".join(parts))
    return _figure(key, caption, y.in_words, svg, [s.name for s in series])


def row_chart(
    key: str,
    caption: str,
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    zones: Sequence[Zone] = (),
) -> str:
    """Values in order as dots, each with a bar from `low` to `high`."""
    reach = [v for s in series for v in (s.y, s.low, s.high) if v is not None]
    reach += [np.array([zone.low, zone.high]) for zone in zones]
    across = x.span or plot.padded([s.x for s in series], least=1.0, share=0.04)
    panel = Panel(*PLACE, across, y.span or plot.padded(reach, least=y.least))
    wanted = min(6, max(1, int(across[1] - across[0]) // 2))
    parts = [
        "".join(_zone(panel, zone) for zone in zones),
        plot.axes(panel, x_unit=x.unit, wanted=(wanted, 4)),
    ]
    for k, s in enumerate(series):
        bars = [] if s.low is None or s.high is None else list(zip(s.x, s.low, s.high, strict=True))
        parts += [
            f'<path class="whisker s{k % LINES}" d="M{float(panel.x(at)):.1f} {float(panel.y(low)):.1f}'
            f'V{float(panel.y(high)):.1f}"/>'
            for at, low, high in bars
            if np.isfinite(low) and np.isfinite(high)
        ]
        parts += [
            _dot(float(panel.x(at)), float(panel.y(value)), k)
            for at, value in zip(s.x, s.y, strict=True)
            if np.isfinite(value)
        ]
    parts.append(_axis_name(panel, x))
    words = f"{y.in_words or caption} over {x.in_words}. {_ends(series, y.unit)}"
    svg = plot.drawing(f"{key}-svg", (WIDTH, HEIGHT), caption, words, "".join(parts))
    return _figure(key, caption, y.in_words, svg, [s.name for s in series], dots=True)


def _dot(x: float, y: float, k: int) -> str:
    """A dot; series differ in shape as well as in colour."""
    shape = ("m-2.5-2.5h5v5h-5z", "m0-3.6l3.6 3.6l-3.6 3.6l-3.6-3.6z", "m0-3.3l3.3 5.8h-6.6z")
    if k % 4 == 0:
        return f'<circle class="dot s{k % LINES}" cx="{x:.1f}" cy="{y:.1f}" r="2.8"/>'
    return f'<path class="dot s{k % LINES}" d="M{x:.1f} {y:.1f}{shape[k % 4 - 1]}"/>'


def _widened(span: tuple[float, float], least: float) -> tuple[float, float]:
    """Widen a range about its middle to at least this width."""
    more = max(0.0, least - (span[1] - span[0])) / 2
    return span[0] - more, span[1] + more


def _extent(values: Sequence[Floats]) -> tuple[float, float]:
    joined = np.concatenate([v[np.isfinite(v)] for v in values])
    if not len(joined):
        return 0.0, 1.0
    low, high = float(joined.min()), float(joined.max())
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _mark(panel: Panel, mark: Mark) -> str:
    if not np.isfinite(mark.value):
        return ""
    at = float(panel.x(mark.value))
    line = f'<path class="mark-line" d="M{at:.1f} {panel.top:.1f}v{panel.height:.1f}"/>'
    return line + plot.label(at, panel.top - 4, mark.name, "small", "middle")


def _zone(panel: Panel, zone: Zone) -> str:
    high, low = float(panel.y(zone.high)), float(panel.y(zone.low))
    shape = (
        f'<rect class="zone" x="{panel.left:.1f}" y="{high:.1f}" width="{panel.width:.1f}" '
        f'height="{max(low - high, 1.0):.1f}"/>'
    )
    return shape + plot.label(panel.left + panel.width - 4, high - 3, zone.name, "small halo", "end")


def _axis_name(panel: Panel, x: Axis) -> str:
    middle, bottom = panel.left + panel.width / 2, panel.top + panel.height
    return plot.label(middle, bottom + 29, x.in_words, "axis-name", "middle")


def _ends(series: Sequence[Series], unit: str) -> str:
    ranges = []
    for s in series:
        finite = s.y[np.isfinite(s.y)]
        if len(finite):
            ranges.append(
                f"{s.name}: from {number(float(finite.min()))} to {number(float(finite.max()))} {unit}"
            )
        else:
            ranges.append(f"{s.name}: not known")
    return "; ".join(ranges) + "."


def _figure(key: str, caption: str, unit: str, svg: str, names: Sequence[str], dots: bool = False) -> str:
    """A drawing with a legend of its lines, or of its dots, if there are several."""
    dash = '<path class="series s{}" d="M0 6H28"/>'
    keys = [(_dot(14.0, 6.0, k) if dots else dash.format(k % LINES), name) for k, name in enumerate(names)]
    return markup.figure(caption, svg, unit=unit, key=key, below=markup.legend(keys) if len(keys) > 1 else "")


# --- studies ------------------------------------------------------------------------------------------


def log_chart(series: Sequence[Series], key: str, caption: str, x_name: str, y_name: str) -> str:
    """Series on two logarithmic axes."""
    powers = [Series(s.name, np.log10(s.x), np.log10(np.where(s.y > 0, s.y, np.nan))) for s in series]
    panel = _panel(powers)
    content = _log_grid(panel) + "".join(_line(panel, s, k) for k, s in enumerate(powers))
    return _of_study(key, caption, f"{y_name} over {x_name}, both logarithmic", content, series)


def line_chart(
    series: Sequence[Series], key: str, caption: str, x_name: str, y_name: str, named: bool = True
) -> str:
    """Series with bands on linear axes; the vertical axis begins at 0. Without `named` there is no legend."""
    panel = _panel(series, from_zero=True)
    content = plot.axes(panel, x_unit="", wanted=(5, 4))
    content += "".join(_band(panel, s, k) for k, s in enumerate(series))
    content += "".join(_line(panel, s, k) for k, s in enumerate(series))
    return _of_study(key, caption, f"{y_name} over {x_name}", content, series if named else ())


def _panel(series: Sequence[Series], from_zero: bool = False) -> Panel:
    across = plot.padded([s.x for s in series], least=1e-9, share=0.03)
    reach = [v for s in series for v in (s.y, s.high) if v is not None]
    up = plot.padded(reach, least=1e-9)
    return Panel(*STUDY_PLACE, across, (0.0, up[1]) if from_zero else up)


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


def _of_study(key: str, caption: str, description: str, content: str, series: Sequence[Series]) -> str:
    svg = plot.drawing(key, STUDY_SIZE, caption, description, content)
    return _figure(f"{key}-figure", caption, description, svg, [s.name for s in series])


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
