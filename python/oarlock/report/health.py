"""The Sensor health section of the report: NIS per reading, and the readings of each stream."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oarlock.evaluation.consistency import ALL_INERTIAL
from oarlock.evaluation.interval import info_of
from oarlock.evaluation.scores import SensorScore
from oarlock.evaluation.summary import rate_text, shares_text
from oarlock.report import plot
from oarlock.report.markup import Column, figure, grid, table
from oarlock.report.text import DASH, breakable, fixed
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import chi2_quantile
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.records import SensorInfo
from oarlock.tracking.track import Track

WIDTH, LEFT, RIGHT, TOP, HEIGHT, FOOT = 400.0, 44.0, 8.0, 6.0, 84.0, 20.0
SMOOTHING_S = 0.5
"""Length of the moving window over which NIS is averaged, s."""


def health_table(scores: tuple[SensorScore, ...]) -> str:
    """NIS per reading of each sensor and closure, and the readings of each stream."""
    counts = [score.count for score in scores if score.count is not None]
    shown = [column for column in _COLUMNS if not column.optional or any(map(column.cell, counts))]
    rows = [
        [breakable(s.name), fixed(s.nis, 2), *((c.cell(s.count) if s.count else "") or DASH for c in shown)]
        for s in scores
    ]
    caption = (
        "Readings of each stream: single numbers, such as one axis of a gyroscope. Expected are those that the stream "
        "gives at its own rate from the first to the last sample of the recording. Rejected are outliers and faulty "
        "readings. Closures (two points coincide, such as a hand and its handle) have a NIS but no stream."
    )
    heads = [Column("sensor"), Column("NIS", meaning=NIS_MEANING), *(column.head for column in shown)]
    for row, score in zip(rows, scores, strict=True):
        if score.name == ALL_INERTIAL:
            row[0] = f'<span title="{ALL_MEANING}">{row[0]}</span>'
    return table("sensors", caption, heads, rows)


NIS_MEANING = (
    "Normalised innovation squared, divided by the number of readings (its degrees of freedom): 1 if innovations are "
    "as large as the filter expects, above 1 if they are larger, below 1 if they are smaller."
)
ALL_MEANING = (
    "The readings of all inertial units of a sample as one measurement, with their joint covariance, divided by "
    "their number. It shows contradictions between units that no single unit shows: check mounts and lengths if it is "
    "far above 1."
)


@dataclass(frozen=True)
class _Counted:
    """A column of a stream's counts. An optional one is left out if it is empty for every stream."""

    head: Column
    cell: Callable[[StreamCount], str]
    optional: bool = False


_COLUMNS = (
    _Counted(Column("rate", "Hz"), lambda c: rate_text(c.rate_hz)),
    _Counted(Column("expected"), lambda c: f"{c.expected:,}"),
    _Counted(Column("used"), lambda c: f"{c.used:,}"),
    _Counted(Column("rejected"), lambda c: f"{c.rejected:,}"),
    _Counted(Column("missing"), lambda c: f"{c.missing:,}"),
    _Counted(
        Column("not needed", meaning="Received and not used, such as readings that a slow sensor repeats."),
        lambda c: f"{c.unused:,}" if c.unused else "",
        optional=True,
    ),
    _Counted(
        Column(
            "disturbed",
            meaning="Share of a magnetometer's samples that were not used, by the first failed test: norm or dip of "
            "the field, or the innovation.",
        ),
        lambda c: shares_text(c.disturbed),
        optional=True,
    ),
    _Counted(
        Column(
            "faults",
            meaning="Share of samples at the limit of the sensor's range (clipped) or exactly constant (stuck).",
        ),
        lambda c: shares_text(c.faults),
        optional=True,
    ),
    _Counted(Column("share"), lambda c: _bar(c)),
)


def _bar(count: StreamCount) -> str:
    if count.expected <= 0:
        return DASH
    parts, left = [], 0.0
    for style in ("used", "rejected", "missing"):
        width = 100 * max(getattr(count, style), 0) / count.expected
        width = max(width, 1.0) if width else 0.0
        parts.append(f'<rect class="{style}" x="{left:.2f}" width="{width:.2f}" height="10"/>')
        left += width
    return (
        f'<svg class="bar" viewBox="0 0 {max(left, 100):.2f} 10" preserveAspectRatio="none" '
        f'aria-hidden="true">{"".join(parts)}</svg>'
    )


def health_section(track: Track, scores: tuple[SensorScore, ...]) -> str:
    """NIS per reading over time, one drawing per sensor that was ever used."""
    info = info_of(track)
    if info is None:
        return ""
    means = {score.name: score.nis for score in scores}
    return grid(
        _nis_figure(track.time_s, info, k, means.get(name, math.nan))
        for k, name in enumerate(info.sensor_names)
        if np.any(info.used[:, k] > 0)
    )


def smoothed_nis(time_s: Floats, nis: Floats, used: Floats) -> tuple[Floats, Floats]:
    """NIS per reading in a centred window of 0.5 s, and the rows in it, (T,) each; NaN where none."""
    counted = np.isfinite(nis) & (used > 0)
    sums = np.concatenate([[0.0], np.cumsum(np.where(counted, nis, 0.0))])
    rows = np.concatenate([[0.0], np.cumsum(np.where(counted, used, 0.0))])
    first = np.searchsorted(time_s, time_s - SMOOTHING_S / 2)
    last = np.searchsorted(time_s, time_s + SMOOTHING_S / 2, side="right")
    degrees = rows[last] - rows[first]
    degrees[~counted] = 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(degrees > 0, (sums[last] - sums[first]) / degrees, np.nan), degrees


def _nis_figure(time_s: Floats, info: SensorInfo, k: int, mean_nis: float) -> str:
    name = info.sensor_names[k]
    nis, degrees = smoothed_nis(time_s, info.nis[:, k], info.used[:, k].astype(float))
    low, high = _expected(degrees)
    finite = nis[np.isfinite(nis) & (nis > 0)]
    extent = (
        (float(np.quantile(finite, 0.005)), float(np.quantile(finite, 0.995))) if len(finite) else (1.0, 1.0)
    )
    decades = math.floor(math.log10(min(extent[0], 0.1))), math.ceil(math.log10(max(extent[1], 10.0)) - 1e-9)
    y_range = 10.0 ** max(decades[0], -4), 10.0 ** min(decades[1], 4)
    panel = plot.over_time(time_s, (LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT), y_range, log_y=True)
    content = "".join(
        [
            plot.axes(panel),
            plot.band(panel, time_s, low, high, "expected"),
            plot.level(panel, 1.0, "zero"),
            plot.line(panel, time_s, nis, "nis"),
        ]
    )
    mean = fixed(mean_nis, 2)
    description = f"NIS per reading over time, mean {mean}, on a logarithmic scale; 1 is expected."
    svg = plot.drawing(
        f"nis-{k}", (WIDTH, TOP + HEIGHT + FOOT), f"{name}: NIS per reading", description, content
    )
    return figure(name, svg, fact=f"NIS {mean}")


def _expected(degrees: Floats) -> tuple[Floats, Floats]:
    """Bounds that contain the averaged NIS of a consistent filter 95 % of the time."""
    distinct, index = np.unique(degrees, return_inverse=True)
    rows = np.maximum(distinct, 1.0)
    low, high = (np.where(distinct > 0, chi2_quantile(p, rows) / rows, np.nan) for p in (0.025, 0.975))
    return low[index], high[index]
