"""Drawings of slow states for the report: biases, base acceleration, azimuth of the magnetic field."""

from __future__ import annotations

import math

import numpy as np

from oarlock.report import plot
from oarlock.report.markup import figure, grid
from oarlock.report.text import number
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.records import SlowSeries
from oarlock.tracking.track import Track

WIDTH, HEIGHT, FOOT = 400.0, 84.0, 20.0
PLACE = (44.0, 6.0, WIDTH - 52.0, HEIGHT)
SHOWN_UNITS = {
    "rad": (180 / math.pi, "deg"),
    "rad/s": (180 / math.pi, "deg/s"),
    "m/s2": (1.0, "m/s²"),
    "m/s^2": (1.0, "m/s²"),
    "m/s3": (1.0, "m/s³"),
}
SETTLED_SHARE = 0.05
"""The vertical range ignores this first share of the time, in which the filter converges."""

Lines = list[tuple[str, SlowSeries]]


def slow_section(track: Track, truth: Track | None) -> str:
    """One drawing per quantity with x, y and z; ground truth is dashed if it has the same name."""
    groups: dict[str, Lines] = {}
    for name, series in track.slow.items():
        group, axis = _group(name)
        groups.setdefault(group, []).append((axis, series))
    return grid(
        _figure(k, track.time_s, name, lines, _true_lines(truth, name, lines))
        for k, (name, lines) in enumerate(groups.items())
    )


def _group(name: str) -> tuple[str, str]:
    """Split a name into quantity and axis: `push_x.rate` is x of `push.rate`."""
    stem, dot, rate = name.partition(".rate")
    group, _, axis = stem.rpartition("_")
    return (f"{group}{dot}{rate}", axis) if axis in {"x", "y", "z"} else (name, "")


def _true_lines(truth: Track | None, group: str, lines: Lines) -> list[tuple[Floats, Floats]]:
    if truth is None:
        return []
    shown = {(group, axis) for axis, _ in lines}
    return [(truth.time_s, series.value) for name, series in truth.slow.items() if _group(name) in shown]


def _figure(key: int, time_s: Floats, name: str, lines: Lines, true: list[tuple[Floats, Floats]]) -> str:
    factor, unit = SHOWN_UNITS.get(lines[0][1].unit, (1.0, lines[0][1].unit))
    scaled = [(axis, series.value * factor, NORMAL_95 * series.std * factor) for axis, series in lines]
    content = _content(time_s, scaled, [(at_s, v * factor) for at_s, v in true])
    ends = ", ".join(f"{axis or 'value'} {number(_last(v))}" for axis, v, _ in scaled)
    description = f"Estimate with its 95 % band; at the end {ends} {unit}."
    size = (WIDTH, PLACE[1] + HEIGHT + FOOT)
    svg = plot.drawing(f"slow-{key}", size, f"{name} over time", description, content)
    swatch = (
        '<span class="axis"><svg viewBox="0 0 22 10" width="22" height="10" aria-hidden="true">'
        '<path class="slow axis-{0}" d="M0 5H22"/></svg>{0}</span>'
    )
    keys = "".join(swatch.format(axis) for axis, _, _ in scaled if axis)
    return figure(name, svg, unit=unit, fact=keys, style="with-truth" if true else "alone")


def _content(
    time_s: Floats, lines: list[tuple[str, Floats, Floats]], true: list[tuple[Floats, Floats]]
) -> str:
    late = time_s >= time_s[0] + SETTLED_SHARE * (time_s[-1] - time_s[0])
    edges = [value[late] + sign * np.nan_to_num(half[late]) for _, value, half in lines for sign in (-1, 1)]
    panel = plot.over_time(time_s, PLACE, plot.padded(edges))
    parts = [plot.axes(panel, wanted=(5, 4)), '<g clip-path="url(#slow-clip)">']
    for axis, value, half in lines:
        parts.append(plot.band(panel, time_s, value - half, value + half, f"band axis-{axis or 'only'}"))
    for axis, value, _ in lines:
        parts.append(plot.line(panel, time_s, value, f"slow axis-{axis or 'only'}"))
    parts += [plot.line(panel, at_s, value, "truth") for at_s, value in true]
    return "".join(parts) + "</g>"


def _last(value: Floats) -> float:
    finite = value[np.isfinite(value)]
    return float(finite[-1]) if len(finite) else math.nan


def clip_definition() -> str:
    """The clipping rectangle of these drawings."""
    return plot.clip("slow-clip", PLACE)
