"""The page of `oarlock markers simulate`: joint values, residuals of the markers, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from oarlock.evaluation.markers.gaps import Gap, stretches
from oarlock.evaluation.markers.simulated import MarkerStudy
from oarlock.evaluation.scores import presentation
from oarlock.model.coordinates import coordinate_units
from oarlock.report import page, plot
from oarlock.report.markup import bar_legend, figure, grid, notes_list, table
from oarlock.report.text import breakable, fixed, percent, plural
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.statistics import NORMAL_95
from oarlock.storage.write_file import write_file

WIDTH, HEIGHT, FOOT = 400.0, 96.0, 20.0
PLACE = (44.0, 6.0, WIDTH - 52.0, HEIGHT)
ROW, NAMES = 13.0, 86.0
_DETERMINED = "<p>Every joint was determined in every frame.</p>"


def write_marker_report(study: MarkerStudy, path: str | Path, title: str = "Marker session") -> Path:
    """Write a page about a marker session that works offline: joints with their bands, residuals, every gap.

    Args:
        study: the result of `oarlock.markers.simulate_from_markers`.
        path: the file to write, or an existing folder, which gets ``report.html``.
        title: heading.

    Returns:
        Path: the file written.
    """
    target = Path(path)
    target = target / "report.html" if target.is_dir() else target
    sections = [
        ("notes", "Notes", notes_list(study.fit.notes) if study.fit.notes else _DETERMINED),
        ("curves", "Joints", _curves(study)),
        ("seen", "Markers", _seen(study) + _residuals(study)),
        ("gaps", "Gaps", _gaps(study.gaps)),
    ]
    definitions = page.definitions() + plot.clip("marker-clip", PLACE)
    lead = f'<div class="lead">{_lead(study)}</div>'
    write_file(target, page.shell(title, lead, sections, definitions))
    return target


def _lead(study: MarkerStudy) -> str:
    fit, markers = study.fit, study.markers
    refused = len(study.filled.refused)
    return (
        f"<p>{plural(len(markers.names), 'marker')} at {markers.rate_hz:.4g} Hz from {fit.time_s[0]:.2f} to "
        f"{fit.time_s[-1]:.2f} s, {percent(1.0 - float((markers.seen & ~study.filled.estimated).mean()))} not visible. "
        f"{plural(len(study.gaps), 'gap')}: {len(study.gaps) - refused} filled, {refused} not filled.</p>"
        f"<p>Residuals are {fixed(fit.noise_scale, 2)} times the standard deviations in the attachments. "
        f"Simulated from this movement: {escape(', '.join(study.recording.names))}.</p>"
    )


def _curves(study: MarkerStudy) -> str:
    fit, figures = study.fit, []
    for k, (name, unit) in enumerate(zip(fit.coordinate_names, coordinate_units(fit.model), strict=True)):
        factor, shown = presentation(unit)
        determined = fit.determined[:, k]
        if determined.any():
            course = (factor * fit.q[:, k], factor * fit.q_std[:, k])
            figures.append(_figure(k, name, shown, fit.time_s, course, determined))
    hint = (
        '<p class="hint">Values with their 95 % band, from the fit and the spread of the residuals. '
        "Hatched: not determined by the markers at that time.</p>"
    )
    return hint + grid(figures)


def _figure(
    key: int, name: str, unit: str, time_s: Floats, course: tuple[Floats, Floats], determined: Bools
) -> str:
    value, std = (np.where(determined, part, np.nan) for part in course)
    half = NORMAL_95 * std
    panel = plot.over_time(time_s, PLACE, plot.padded([value - half, value + half]))
    lost = "".join(
        plot.span(panel, float(time_s[a]), float(time_s[b - 1]), "unseen-span")
        for a, b in stretches(~determined)
    )
    content = (
        f'{plot.axes(panel, wanted=(5, 4))}<g clip-path="url(#marker-clip)">{lost}'
        f"{plot.band(panel, time_s, value - half, value + half, 'band strong')}"
        f"{plot.line(panel, time_s, value, 'estimate')}</g>"
    )
    middle = float(np.nanmedian(std))
    span = f"{np.nanmin(value):.1f} to {np.nanmax(value):.1f} {unit}"
    description = f"From {span}, standard deviation {middle:.2g} {unit}."
    svg = plot.drawing(
        f"joint-{key}", (WIDTH, PLACE[1] + HEIGHT + FOOT), f"{name} over time", description, content
    )
    return figure(name, svg, unit=unit, fact=f"std {middle:.2g}")


def _seen(study: MarkerStudy) -> str:
    """One line per marker: seen, filled, missing."""
    names, time_s = study.markers.names, study.fit.time_s
    height = ROW * len(names)
    panel = plot.over_time(time_s, (NAMES, 4.0, 800.0 - NAMES - 10.0, height), (0.0, 1.0))
    parts = []
    for k, name in enumerate(names):
        row = plot.Panel(panel.left, 4.0 + k * ROW + 2.0, panel.width, ROW - 4.0, panel.x_range, (0.0, 1.0))
        put_in = study.filled.estimated[:, k]
        kinds = (
            ("used", study.markers.seen[:, k] & ~put_in),
            ("rejected", put_in),
            ("missing", ~study.markers.seen[:, k]),
        )
        for style, frames in kinds:
            parts += [
                plot.span(row, float(time_s[a]), float(time_s[min(b, len(time_s) - 1)]), style)
                for a, b in stretches(np.asarray(frames))
            ]
        parts.append(plot.label(NAMES - 6.0, row.top + ROW - 5.0, name[:14], anchor="end"))
    ticks = plot.ticks(*panel.x_range, wanted=6)
    *labels, last = plot.tick_labels(ticks)
    parts += [
        plot.label(float(panel.x(value)), height + 18.0, text, anchor="middle")
        for value, text in zip(ticks, [*labels, f"{last} s"], strict=True)
    ]
    keys = bar_legend((("used", "seen"), ("rejected", "put in"), ("missing", "missing")))
    svg = plot.drawing(
        "seen", (800.0, height + 24.0), "Visibility of each marker over time", "Time in s.", "".join(parts)
    )
    return f"{keys}<figure>{svg}</figure>"


def _residuals(study: MarkerStudy) -> str:
    seen = (study.markers.seen & ~study.filled.estimated).mean(axis=0)
    at = {a.marker: a for a in study.fit.attachments}
    rows = [
        [
            breakable(name),
            breakable(at[name].frame),
            percent(float(seen[k])),
            fixed(1e3 * study.fit.rmse_m[name], 1),
        ]
        for k, name in enumerate(study.markers.names)
    ]
    caption = "Root mean square distance of each marker, filled and filtered, from its point on the model."
    return table("residuals", caption, ["marker", "frame", "seen", "mm"], rows)


def _gaps(gaps: Sequence[Gap]) -> str:
    if not gaps:
        return "<p>There were no gaps.</p>"
    rows = [
        [
            breakable(gap.marker),
            fixed(gap.start_s, 3),
            fixed(gap.end_s, 3),
            fixed(gap.duration_s, 3),
            str(gap.frames),
            "filled" if gap.filled else escape(gap.reason),
        ]
        for gap in gaps
    ]
    head = ["marker", "from s", "to s", "length s", "frames", "treatment"]
    return table("gaps", "Every gap, by marker and time.", head, rows)
