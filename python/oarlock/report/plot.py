"""Elements of SVG plots for all pages: scales, ticks, decimated lines and bands. CSS classes set the colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np

from oarlock.report.text import MINUS
from oarlock.storage.arrays import Bools, Floats, Indices

BUCKETS = 280
"""Columns of a decimated curve; each keeps its smallest and largest sample."""


@dataclass(frozen=True)
class Panel:
    """A rectangle in the drawing (units of its viewBox) and the ranges that it shows."""

    left: float
    top: float
    width: float
    height: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    log_y: bool = False

    def x(self, value: Floats | float) -> Floats:
        """Horizontal position."""
        low, high = self.x_range
        return np.asarray(self.left + (np.asarray(value) - low) / (high - low) * self.width)

    def y(self, value: Floats | float) -> Floats:
        """Vertical position, limited to the panel and a margin."""
        low, high = (math.log10(v) if self.log_y else v for v in self.y_range)
        shown = np.log10(np.maximum(value, 1e-300)) if self.log_y else np.asarray(value)
        position = self.top + (high - shown) / (high - low) * self.height
        return np.asarray(np.clip(position, self.top - self.height, self.top + 2 * self.height))


def over_time(
    time_s: Floats,
    place: tuple[float, float, float, float],
    y_range: tuple[float, float],
    log_y: bool = False,
) -> Panel:
    """A panel at left, top, width, height whose horizontal axis is the whole of ``time_s``."""
    start, end = float(time_s[0]), float(time_s[-1])
    extent = (start, end) if end > start else (start - 0.5, end + 0.5)
    return Panel(*place, extent, y_range, log_y)


def clip(key: str, place: tuple[float, float, float, float]) -> str:
    """A hidden drawing with a clipping rectangle for other drawings."""
    left, top, width, height = place
    return (
        f'<svg class="definitions" width="0" height="0" aria-hidden="true"><clipPath id="{key}">'
        f'<rect x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"/></clipPath></svg>'
    )


def padded(values: Sequence[Floats], least: float = 0.0, share: float = 0.06) -> tuple[float, float]:
    """Range of all finite values with a margin; at least ``least`` wide."""
    joined = np.concatenate([v[np.isfinite(v)] for v in values])
    low, high = (float(joined.min()), float(joined.max())) if len(joined) else (-1.0, 1.0)
    margin = max(share * (high - low), (least - (high - low)) / 2, 1e-12 * max(abs(low), abs(high), 1e-3))
    return low - margin, high + margin


def ticks(low: float, high: float, wanted: int = 4) -> list[float]:
    """Round numbers (1, 2, 2.5 or 5 times a power of ten) inside a range."""
    rough = (high - low) / max(wanted, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s * power for s in (1, 2, 2.5, 5, 10) if s * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def tick_labels(values: Sequence[float]) -> list[str]:
    """The values as text with the decimals that their spacing needs."""
    gaps = [abs(b - a) for a, b in pairwise(values)] or [abs(v) for v in values if v]
    step = min(gaps, default=1.0)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9)) if step else 0
    if decimals < 12 and abs(round(step, decimals) - step) > 1e-6 * step:
        decimals += 1
    return [f"{v if abs(v) > 1e-9 * step else 0.0:.{decimals}f}".replace("-", MINUS) for v in values]


def decimate(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """At most two samples per column: the smallest and the largest, in order of time. NaN marks a gap."""
    if len(x) <= 2 * BUCKETS:
        return x, y
    places, is_in = _buckets(len(x))
    values, good = y[places], np.isfinite(y[places]) & is_in
    lowest = np.argmin(np.where(good, values, np.inf), axis=1)
    highest = np.argmax(np.where(good, values, -np.inf), axis=1)
    ends = np.sort(np.stack([lowest, highest], axis=1), axis=1)
    kept = np.take_along_axis(places, ends, axis=1)
    heights, is_seen = y[kept], good.any(axis=1)
    heights[~is_seen] = np.nan
    # One sample is enough where the smallest is the largest, and for a gap.
    chosen = np.stack([np.ones(len(kept), dtype=bool), is_seen & (ends[:, 0] != ends[:, 1])], axis=1)
    return x[kept][chosen], heights[chosen]


def envelope(x: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """A band with one pair of bounds per bucket, never narrower than the band itself."""
    if len(x) <= BUCKETS:
        return x, low, high
    places, is_in = _buckets(len(x))
    good = np.isfinite(low[places]) & np.isfinite(high[places]) & is_in
    lower = np.where(good, low[places], np.inf).min(axis=1)
    upper = np.where(good, high[places], -np.inf).max(axis=1)
    lower[~good.any(axis=1)] = upper[~good.any(axis=1)] = np.nan
    middle = np.mean(x[places], axis=1, where=is_in)
    middle[0], middle[-1] = x[0], x[-1]
    return middle, lower, upper


def _buckets(samples: int) -> tuple[Indices, Bools]:
    """(BUCKETS, n) indices of the samples of each bucket, and which of them are its own: n is that of the longest."""
    edges = np.linspace(0, samples, BUCKETS + 1).astype(int)
    places = edges[:-1, None] + np.arange(np.diff(edges).max())
    return np.minimum(places, samples - 1), places < edges[1:, None]


def line(panel: Panel, x: Floats, y: Floats, style: str) -> str:
    """A decimated curve with its gaps."""
    xs, ys = decimate(x, y)
    return f'<path class="{style}" d="{_path(panel.x(xs), panel.y(ys))}"/>'


def band(panel: Panel, x: Floats, low: Floats, high: Floats, style: str) -> str:
    """A filled band between two curves, with its gaps."""
    xs, lows, highs = envelope(x, low, high)
    good = np.isfinite(lows) & np.isfinite(highs)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8))).reshape(-1, 2)
    shapes = []
    for a, b in edges:
        around = np.concatenate([xs[a:b], xs[a:b][::-1]])
        bounds = np.concatenate([highs[a:b], lows[a:b][::-1]])
        shapes.append(_path(panel.x(around), panel.y(bounds)) + "Z")
    return f'<path class="{style}" d="{"".join(shapes)}"/>' if shapes else ""


def span(panel: Panel, start: float, end: float, style: str) -> str:
    """A shaded interval of the horizontal axis over the panel's height."""
    a, b = (float(panel.x(min(max(v, panel.x_range[0]), panel.x_range[1]))) for v in (start, end))
    return (
        f'<rect class="{style}" x="{a:.1f}" y="{panel.top:.1f}" width="{max(b - a, 0.5):.1f}" '
        f'height="{panel.height:.1f}"/>'
    )


def level(panel: Panel, value: float, style: str) -> str:
    """A horizontal line across the panel."""
    y = float(panel.y(value))
    return f'<path class="{style}" d="M{panel.left:.1f} {y:.1f}h{panel.width:.1f}"/>'


def label(x: float, y: float, text: str, style: str = "", anchor: str = "start") -> str:
    """Text in the drawing."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{style}">{escape(text)}</text>'


def axes(panel: Panel, x_unit: str = "s", wanted: tuple[int, int] = (5, 3)) -> str:
    """Grid, tick labels and the unit of the horizontal axis after its last label."""
    xs = ticks(*panel.x_range, wanted=wanted[0])
    ys = _decades(panel) if panel.log_y else ticks(*panel.y_range, wanted=wanted[1])
    bottom = panel.top + panel.height
    grid = "".join(f"M{panel.left:.1f} {float(panel.y(v)):.1f}h{panel.width:.1f}" for v in ys)
    marks = "".join(f"M{float(panel.x(v)):.1f} {bottom:.1f}v3" for v in xs)
    names = tick_labels(xs)
    names[-1:] = [f"{name} {x_unit}" for name in names[-1:]]
    heights = [f"{v:g}" for v in ys] if panel.log_y else tick_labels(ys)
    parts = [f'<path class="grid" d="{grid}"/><path class="tick" d="{marks}"/>']
    parts += [
        label(panel.left - 5, float(panel.y(v)) + 3.5, t, anchor="end")
        for v, t in zip(ys, heights, strict=True)
    ]
    for value, name in zip(xs, names, strict=True):
        near_end = float(panel.x(value)) > panel.left + panel.width - 8
        anchor = "end" if near_end else "middle"
        shift = 6 if near_end else 0
        parts.append(label(float(panel.x(value)) + shift, bottom + 14, name, anchor=anchor))
    return "".join(parts)


def drawing(key: str, size: tuple[float, float], title: str, description: str, content: str) -> str:
    """An SVG element with a title and a description that screen readers speak."""
    return (
        f'<svg viewBox="0 0 {size[0]:g} {size[1]:g}" role="img" aria-labelledby="{key}-t {key}-d">'
        f'<title id="{key}-t">{escape(title)}</title><desc id="{key}-d">{escape(description)}</desc>'
        f"{content}</svg>"
    )


def _decades(panel: Panel) -> list[float]:
    low, high = (math.log10(v) for v in panel.y_range)
    return [10.0**k for k in range(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)]


def _path(x: Floats, y: Floats) -> str:
    pieces, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if not math.isfinite(b):
            pen = "M"
            continue
        pieces.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L"
    return "".join(pieces)
