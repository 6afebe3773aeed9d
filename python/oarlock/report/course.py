"""Charts for field sections: curves with bands, paths in a plane, values with intervals in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.report import markup, plot
from oarlock.report.chart import LINES, Series
from oarlock.report.plot import Floats, Panel
from oarlock.report.text import number

WIDTH, HEIGHT = 400.0, 214.0
PLACE = (40.0, 14.0, 354.0, 160.0)
TALLEST = 250.0


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
    zones: Sequence[Zone] = (),
    fact: str = "",
) -> str:
    """Series with bands over one axis, with marks and zones behind them. A single series has no legend."""
    reach = [v for s in series for v in (s.y, s.low, s.high) if v is not None]
    reach += [np.array([zone.low, zone.high]) for zone in zones]
    panel = Panel(
        *PLACE, x.span or _extent([s.x for s in series]), y.span or plot.padded(reach, least=y.least)
    )
    content = "".join(
        [
            "".join(_zone(panel, zone) for zone in zones),
            plot.axes(panel, x_unit=x.unit, wanted=(5, 4)),
            plot.level(panel, 0.0, "zero") if panel.y_range[0] < 0 < panel.y_range[1] else "",
            "".join(_mark(panel, mark) for mark in marks),
            "".join(_band(panel, s, k) for k, s in enumerate(series)),
            "".join(plot.line(panel, s.x, s.y, f"series s{k % LINES}") for k, s in enumerate(series)),
            _axis_name(panel, x),
        ]
    )
    words = f"{y.in_words or caption} over {x.in_words}. {_ends(series, y.unit)}"
    return _figure(key, caption, y, fact, _drawn(key, (WIDTH, HEIGHT), caption, words, content), series)


def plane_chart(
    key: str,
    caption: str,
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    points: Sequence[tuple[float, float, str]] = (),
    faint: Sequence[Series] = (),
    taller: float = 1.0,
    fact: str = "",
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
    size = (WIDTH, top + height + 44.0)
    return _figure(key, caption, y, fact, _drawn(key, size, caption, words, "".join(parts)), series)


def row_chart(
    key: str,
    caption: str,
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    zones: Sequence[Zone] = (),
    fact: str = "",
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
    svg = _drawn(key, (WIDTH, HEIGHT), caption, words, "".join(parts))
    return _figure(key, caption, y, fact, svg, series, dots=True)


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
    finite = [v[np.isfinite(v)] for v in values]
    joined = np.concatenate(finite) if finite else np.empty(0)
    if not len(joined):
        return 0.0, 1.0
    low, high = float(joined.min()), float(joined.max())
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _band(panel: Panel, series: Series, k: int) -> str:
    if series.low is None or series.high is None:
        return ""
    return plot.band(panel, series.x, series.low, series.high, f"series-band s{k % LINES}")


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


def _drawn(key: str, size: tuple[float, float], caption: str, words: str, content: str) -> str:
    return plot.drawing(f"{key}-svg", size, caption, words, content)


def _figure(
    key: str, caption: str, y: Axis, fact: str, svg: str, series: Sequence[Series], dots: bool = False
) -> str:
    keys = [(_dot(14.0, 6.0, k) if dots else _dash(k), s.name) for k, s in enumerate(series)]
    below = markup.legend(keys) if len(keys) > 1 else ""
    return markup.figure(caption, svg, unit=y.in_words, fact=fact, key=key, below=below)


def _dash(k: int) -> str:
    return f'<path class="series s{k % LINES}" d="M0 6H28"/>'
