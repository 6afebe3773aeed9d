"""The Sensor health section of the report: NIS per measurement and the share of readings used."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from oarlock.evaluation.consistency import chi2_quantile
from oarlock.evaluation.interval import Floats, info_of
from oarlock.evaluation.scores import SensorScore
from oarlock.report import plot
from oarlock.report.markup import figure, grid, table
from oarlock.report.text import DASH, breakable, fixed
from oarlock.tracking.records import SensorInfo
from oarlock.tracking.track import Track

WIDTH, LEFT, RIGHT, TOP, HEIGHT, FOOT = 400.0, 44.0, 8.0, 6.0, 84.0, 20.0
SMOOTHING_S = 0.5
"""Length of the moving window over which NIS is averaged, s."""


def health_table(scores: tuple[SensorScore, ...]) -> str:
    """NIS per measurement and rows used, rejected and missing of each sensor and closure."""
    rows = [
        [breakable(s.name), fixed(s.nis, 2), *_counts(s), _shares(s.disturbed), _shares(s.faults), _bar(s)]
        for s in scores
    ]
    caption = (
        "Single readings (channels) of each sensor, and of each closure: the constraint that two points coincide, such "
        "as a hand and its handle. NIS per measurement is 1 if innovations are as large as the filter expects; above 1 "
        "they are larger, below 1 smaller. Disturbed: share of a magnetometer's samples that were not used, by the "
        "first failed test: the field's norm, its dip, the innovation. Faults: share of samples at the limit of the "
        "sensor's range (clipped) or exactly constant (stuck), which were not used either."
    )
    return table(
        "sensors",
        caption,
        ["sensor", "NIS", "used", "rejected", "missing", "disturbed", "faults", "share"],
        rows,
    )


def _counts(score: SensorScore) -> list[str]:
    return [f"{n:,}" if n else "0" for n in (score.used, score.rejected, score.missing)]


def _shares(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares.items()) or DASH


def _bar(score: SensorScore) -> str:
    total = score.used + score.rejected + score.missing
    if not total:
        return DASH
    parts, left = [], 0.0
    for style in ("used", "rejected", "missing"):
        width = 100 * getattr(score, style) / total
        width = max(width, 1.0) if width else 0.0
        parts.append(f'<rect class="{style}" x="{left:.2f}" width="{width:.2f}" height="10"/>')
        left += width
    return (
        f'<svg class="bar" viewBox="0 0 {max(left, 100):.2f} 10" preserveAspectRatio="none" '
        f'aria-hidden="true">{"".join(parts)}</svg>'
    )


def health_section(track: Track, scores: tuple[SensorScore, ...]) -> str:
    """NIS per measurement over time, one drawing per sensor that was ever used."""
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
    """NIS per measurement in a centred window of 0.5 s, and the rows in it, (T,) each; NaN where none."""
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
    description = f"NIS per measurement over time, mean {mean}, on a logarithmic scale; 1 is expected."
    svg = plot.drawing(
        f"nis-{k}", (WIDTH, TOP + HEIGHT + FOOT), f"{name}: NIS per measurement", description, content
    )
    return figure(name, svg, fact=f"NIS {mean}")


def _expected(degrees: Floats) -> tuple[Floats, Floats]:
    """Bounds that contain the averaged NIS of a consistent filter 95 % of the time."""
    distinct, index = np.unique(degrees, return_inverse=True)
    rows = np.maximum(distinct, 1.0)
    low, high = (np.where(distinct > 0, chi2_quantile(p, rows) / rows, np.nan) for p in (0.025, 0.975))
    return low[index], high[index]
