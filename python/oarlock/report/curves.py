"""Drawings of the report's Curves section: every joint over time, with error and band of a few seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from html import escape

import numpy as np

from oarlock.evaluation.angles import angle_error, named_angles
from oarlock.evaluation.errors import part_error
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.joints import part_unit
from oarlock.evaluation.scores import Evaluation, JointScore, presentation
from oarlock.model.coordinates import JointPart, parts
from oarlock.report import markup, plot
from oarlock.report.text import MINUS, number, percent
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.track import Track

WIDTH, LEFT, RIGHT = 400.0, 44.0, 8.0
CURVE_TOP, CURVE_HEIGHT, STRIP_GAP, STRIP_HEIGHT, FOOT = 6.0, 118.0, 40.0, 62.0, 20.0
DETAIL_S = 3.0
"""Length of the interval in which the error is drawn, s."""
SETTLED_SHARE = 0.05
"""The scale of a band's width ignores this first share of the time, in which the filter converges."""
SINGULAR_HINT = (
    '<p class="hint">Tinted grey: the middle angle of a ball or free joint is within 15 deg of a pole. Its first '
    "and last angle are not unique there, only their sum or difference; bands and errors are not shown. The "
    "orientation itself is not affected.</p>"
)


@dataclass(frozen=True)
class ErrorCurve:
    """A hinge, slide, position axis or named angle in the drawn unit (deg, m or mm); (T,) each."""

    name: str
    unit: str
    time_s: Floats
    value: Floats
    half_band: Floats
    error: Floats | None
    observed: Bools
    near_singular: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    reference: str = "truth"

    @property
    def seen(self) -> bool:
        """Whether a sensor observed it at least half of the time."""
        return bool(np.mean(self.observed) >= 0.5)


def curves_section(track: Track, truth: Track | None, evaluation: Evaluation | None) -> str:
    """The grid of drawings with its legend."""
    reference = "truth" if evaluation is None or evaluation.reference == "truth" else "reference"
    window = detail_window(track, truth)
    drawn = [curve for part in parts(track.coordinate_names) for curve in _curves(track, truth, part)]
    scored = evaluation.joints if evaluation else ()
    scores = {part.name: part for score in reversed(scored) for part in reversed((score, *score.parts))}
    figures = [
        figure(f"joint-{i}", replace(c, reference=reference), window, _headline(c, scores.get(c.name)))
        for i, c in enumerate(drawn)
    ]
    near = SINGULAR_HINT if any(curve.near_singular.any() for curve in drawn) else ""
    shown = reference if truth is not None else None
    return f"{legend(shown, window)}{near}{markup.grid(figures, 'tall')}"


def detail_window(track: Track, truth: Track | None) -> Interval:
    """The middle seconds of the track, or of its overlap with the truth."""
    start, end = float(track.time_s[0]), float(track.time_s[-1])
    if truth is not None and len(truth.time_s):
        start, end = max(start, float(truth.time_s[0])), min(end, float(truth.time_s[-1]))
    middle, half = (start + end) / 2, min(DETAIL_S, end - start) / 2
    return Interval(middle - half, middle + half)


def _curves(track: Track, truth: Track | None, part: JointPart) -> list[ErrorCurve]:
    """One curve of a hinge or slide, three of a position; named angles of a rotation, without bands near a pole."""
    columns = list(part.columns)
    observed: Bools = np.asarray(track.observed[:, columns].all(axis=1))
    if part.kind == "rotation":
        angles = named_angles(track, part)
        near = angles.near_singular
        names, value = angles.names, angles.value
        std = np.where(near[:, None], np.nan, angles.std)
        error = None if truth is None else angle_error(track, truth, part)
    else:
        near = np.zeros(len(track.time_s), dtype=bool)
        names = tuple(track.coordinate_names[column] for column in columns)
        value, std = track.q[:, columns], track.q_std[:, columns]
        error = None if truth is None else part_error(track, truth, part)
    si_unit = part_unit(track, part)
    found = []
    for k, name in enumerate(names):
        shown, good = value[:, k].copy(), np.isfinite(value[:, k])
        if si_unit == "rad":
            unit, factor = "deg", 180 / math.pi
            shown[good] = np.unwrap(shown[good])
        else:
            unit, factor = ("m", 1.0) if good.any() and np.ptp(shown[good]) > 0.1 else ("mm", 1e3)
        half = NORMAL_95 * std[:, k] * factor
        scaled = None if error is None else error[:, k] * factor
        found.append(ErrorCurve(name, unit, track.time_s, shown * factor, half, scaled, observed, near))
    return found


def figure(key: str, curve: ErrorCurve, window: Interval, headline: str) -> str:
    """A curve, and below it a few seconds of its error with its band; `headline` is markup."""
    style = "with-truth" if curve.error is not None else "alone"
    style = style if curve.seen else "unseen"
    drawing = _svg(key, curve, window)
    return markup.figure(curve.name, drawing, unit=curve.unit, fact=headline, key=key, style=style)


def _headline(curve: ErrorCurve, score: JointScore | None) -> str:
    if not curve.seen:
        return "not observed"
    if score is None or not score.observed:
        return escape(score.note) if score else ""
    factor, unit = presentation(score.unit)
    inside = f" · {percent(score.coverage)} in band" if math.isfinite(score.coverage) else ""
    return f"RMSE {number(score.rmse * factor)} {unit}{inside}"


def _svg(key: str, curve: ErrorCurve, window: Interval) -> str:
    size = (WIDTH, CURVE_TOP + CURVE_HEIGHT + FOOT)
    content = _course(curve, window)
    if curve.seen and np.isfinite(curve.value).any():
        top = CURVE_TOP + CURVE_HEIGHT + STRIP_GAP
        size = (WIDTH, top + STRIP_HEIGHT + FOOT)
        scored = _has_error(curve, window)
        content += _error_strip(curve, window, top) if scored else _band_strip(curve, top)
    return plot.drawing(f"{key}-svg", size, f"{curve.name} over time", _description(curve), content)


def _has_error(curve: ErrorCurve, window: Interval) -> bool:
    if curve.error is None or not curve.seen:
        return False
    return bool(np.isfinite(curve.error[window.of(curve.time_s)]).any())


def _description(curve: ErrorCurve) -> str:
    finite = curve.value[np.isfinite(curve.value)]
    if not curve.seen or not len(finite):
        return "Not observed: no working sensor measures this joint."
    return (
        f"Estimate with its 95 % band over time, from {number(float(finite.min()))} to "
        f"{number(float(finite.max()))} {curve.unit}."
    )


def _course(curve: ErrorCurve, window: Interval) -> str:
    low, high = curve.value - curve.half_band, curve.value + curve.half_band
    true = None if curve.error is None else curve.value - curve.error
    shown = [curve.value, *([] if true is None else [true])]
    panel = _panel(
        curve, CURVE_TOP, CURVE_HEIGHT, plot.padded(shown, least=0.02 if curve.unit == "m" else 2.0)
    )
    if not curve.seen and not np.isfinite(curve.value).any():
        return plot.span(panel, *panel.x_range, "blank") + _stamp(panel)
    parts = [
        plot.span(panel, window.start_s, window.end_s, "detail") if _has_error(curve, window) else "",
        plot.axes(panel),
        _spans(panel, curve.time_s, curve.near_singular, "singular-span"),
        _spans(panel, curve.time_s, ~curve.observed, "unseen-span") if curve.seen else "",
        '<g clip-path="url(#plot-clip)">',
    ]
    parts += [plot.band(panel, curve.time_s, low, high, "band")]
    parts.append(plot.line(panel, curve.time_s, curve.value, "estimate"))
    if true is not None and np.isfinite(true).any():
        parts.append(plot.line(panel, curve.time_s, true, "truth"))
    parts.append("</g>")
    return "".join(parts) + ("" if curve.seen else _stamp(panel))


def _stamp(panel: plot.Panel) -> str:
    x, y = panel.left + panel.width / 2, panel.top + panel.height / 2
    return plot.label(x, y + 5, "not observed", "stamp", "middle")


def _error_strip(curve: ErrorCurve, window: Interval, top: float) -> str:
    """Error in ``window`` with the 95 % band of the track."""
    assert curve.error is not None
    factor, unit = _fine(curve)
    inside = window.of(curve.time_s)
    time_s, error, half = curve.time_s[inside], curve.error[inside] * factor, curve.half_band[inside] * factor
    # the band, and the errors unless they are much larger
    largest = [float(np.nanmax(v)) for v in (np.abs(error), half) if np.isfinite(v).any()]
    reach = 1.15 * max(largest, default=1.0) or 1.0
    panel = plot.Panel(
        LEFT, top, WIDTH - LEFT - RIGHT, STRIP_HEIGHT, (window.start_s, window.end_s), (-reach, reach)
    )
    name = f"estimate {MINUS} {curve.reference}, {unit}"
    return "".join(
        [
            plot.label(LEFT, top - 7, name, "strip-name"),
            plot.axes(panel, wanted=(3, 4)),
            plot.band(panel, time_s, -half, half, "band strong"),
            plot.level(panel, 0.0, "zero"),
            plot.line(panel, time_s, error, "error"),
        ]
    )


def _band_strip(curve: ErrorCurve, top: float) -> str:
    """Half-width of the 95 % band over the whole track, without ground truth."""
    factor, unit = _fine(curve)
    half = curve.half_band * factor
    if not np.isfinite(half).any():
        return plot.label(LEFT, top - 7, "no standard deviation", "strip-name")
    settled = half[curve.time_s >= curve.time_s[0] + SETTLED_SHARE * np.ptp(curve.time_s)]
    high = 1.25 * float(np.nanmax(settled if np.isfinite(settled).any() else half)) or 1.0
    panel = _panel(curve, top, STRIP_HEIGHT, (0.0, high))
    name = plot.label(LEFT, top - 7, f"half-width of the 95 % band, {unit}", "strip-name")
    curve_line = plot.line(panel, curve.time_s, half, "nis")
    return f'{name}{plot.axes(panel, wanted=(5, 3))}<g clip-path="url(#strip-clip)">{curve_line}</g>'


def _fine(curve: ErrorCurve) -> tuple[float, str]:
    return (1e3, "mm") if curve.unit == "m" else (1.0, curve.unit)


def _panel(curve: ErrorCurve, top: float, height: float, y_range: tuple[float, float]) -> plot.Panel:
    return plot.over_time(curve.time_s, (LEFT, top, WIDTH - LEFT - RIGHT, height), y_range)


def _spans(panel: plot.Panel, time_s: Floats, marked: Bools, style: str) -> str:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    pairs = edges.reshape(-1, 2)[:200]
    return "".join(plot.span(panel, time_s[a], time_s[b - 1], style) for a, b in pairs)


def clip_definition() -> str:
    """The clipping rectangles of all joint drawings: of the curve and of the strip below it."""
    width, strip_top = WIDTH - LEFT - RIGHT, CURVE_TOP + CURVE_HEIGHT + STRIP_GAP
    course = plot.clip("plot-clip", (LEFT, CURVE_TOP, width, CURVE_HEIGHT))
    return course + plot.clip("strip-clip", (LEFT, strip_top, width, STRIP_HEIGHT))


def legend(reference: str | None, window: Interval) -> str:
    """The legend of lines and bands; without a reference there are no errors."""
    entries = [("estimate", "estimate"), ("band", "95 % band")]
    if reference is not None:
        entries += [("truth", reference), ("error", f"estimate {MINUS} {reference}")]
    lines = '<path class="{}" d="M0 6H28"/>'
    band = '<rect class="band strong" width="28" height="12"/>'
    keys = [(band if style == "band" else lines.format(style), text) for style, text in entries]
    style = "with-truth" if reference is not None else "alone"
    below = (
        f"Below each curve: its error from {window.start_s:.1f} to {window.end_s:.1f} s (tinted above), "
        "enlarged, with the 95 % band of the track."
        if reference is not None
        else "Below each curve: half the width of its 95 % band, enlarged."
    )
    hint = f"{below} Hatched: not observed during this time."
    return f'{markup.legend(keys, style=style)}<p class="hint">{hint}</p>'
