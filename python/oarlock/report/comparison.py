"""The page of `oarlock lab compare`: a table, errors as bars, and errors over time per step."""

from __future__ import annotations

import math
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.report.markup import bar_legend, figure, notes_list, table
from oarlock.report.page import shell
from oarlock.report.plot import Panel, drawing, label
from oarlock.report.text import DASH, breakable, number, percent
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from oarlock.evaluation.comparison.comparison import Comparison
    from oarlock.evaluation.comparison.scores import Score

FAMILIES = ("tree", "limbs", "single units")
_MEANING = {
    "tree": "the whole body in one filter",
    "limbs": "one filter per limb",
    "single units": "one filter per inertial unit, then inverse kinematics",
}
_HEAD = {
    "mean_rmse_deg": "mean angle, deg",
    "worst_rmse_deg": "worst angle, deg",
    "correlation": "correlation",
    "nees_per_state": "NEES per state",
    "coverage_95": "in 95 % band",
    "step_us": "filter, µs a step",
    "kinematics_us": "inverse kinematics, µs",
    "steps_per_s": "steps/s",
}


def write_comparison(found: Comparison, path: str | Path, title: str) -> Path:
    """Write the page; it works offline: no script, no request."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_file(target, _page(found, title))
    return target


def _page(found: Comparison, title: str) -> str:
    sections = (
        (
            "errors",
            "Errors and times",
            bar_legend((_style_of(f), _MEANING[f]) for f in FAMILIES) + _pictures(found),
        ),
        ("numbers", "All numbers", _numbers(found)),
        ("estimators", "Definitions", _what(found)),
        ("notes", "Notes", _notes(found)),
    )
    own = files(__package__).joinpath("comparison.css").read_text(encoding="utf-8")
    return shell(title, f'<div class="lead">{_lead(found)}</div>', sections, style=own)


def _lead(found: Comparison) -> str:
    wins = found.wins
    if found.reference != "truth":
        return (
            f"<p>Without ground truth, all values are differences from <b>{escape(found.reference)}</b>.</p>"
        )
    if "mean_rmse_deg" not in wins:
        return "<p>No joint could be scored.</p>"
    first = found[wins["mean_rmse_deg"][0]]
    parts = [f"Least mean error: <b>{_named(wins['mean_rmse_deg'])}</b>, {number(first.mean_rmse_deg)} deg."]
    for family in FAMILIES:
        rows = [r for r in found.scores if r.estimator.family == family and math.isfinite(r.mean_rmse_deg)]
        top = min(rows, key=lambda row: row.mean_rmse_deg, default=None)
        if top is not None and family != first.estimator.family:
            ratio = top.mean_rmse_deg / first.mean_rmse_deg
            parts.append(
                f"Best with {_MEANING[family]}: <b>{escape(top.name)}</b>, {number(top.mean_rmse_deg)} deg, "
                f"{number(ratio, 2)} times as much."
            )
    fastest = found[wins["step_us"][0]]
    parts.append(f"Fastest: <b>{escape(fastest.name)}</b>, {number(fastest.step_us)} µs a step.")
    return f"<p>{' '.join(parts)}</p>"


def _named(names: tuple[str, ...]) -> str:
    if len(names) == 1:
        return escape(names[0])
    return f"{escape(names[0])} (level: {escape(', '.join(names[1:]))})"


def _style_of(family: str) -> str:
    return "family-" + family.replace(" ", "-")


def _pictures(found: Comparison) -> str:
    errors = [row for row in found.scores if row.mean_rmse_deg > 0.0]
    if not errors:
        return ""
    time = "deg over µs a step of the filter alone, both logarithmic; down and left is better"
    bars = figure("Mean angle error", _bars(errors), unit="deg, logarithmic")
    return f'<div class="pictures">{bars}{figure("Error over time", _scatter(errors), unit=time)}</div>'


ROW = 22.0


def _bars(rows: list[Score]) -> str:
    low = 10 ** math.floor(math.log10(min(r.mean_rmse_deg for r in rows)) - 0.2)
    high = 10 ** math.ceil(math.log10(max(r.mean_rmse_deg for r in rows)))
    left, width = 118.0, 290.0
    span = math.log10(high / low)
    parts = []
    bottom = ROW * len(rows) + 4
    for power in range(round(math.log10(low)), round(math.log10(high)) + 1):
        x = left + width * (power - math.log10(low)) / span
        parts.append(f'<path class="grid" d="M{x:.1f} 0V{bottom:.1f}"/>')
        parts.append(label(x, bottom + 13, f"{10.0**power:g}", anchor="middle"))
    for i, row in enumerate(rows):
        y, length = ROW * i + 4, width * math.log10(row.mean_rmse_deg / low) / span
        parts.append(label(left - 6, y + 12, row.name, "strip-name", "end"))
        place = f'x="{left}" y="{y:.1f}" width="{length:.1f}" height="15" rx="2"'
        parts.append(f'<rect class="{_style_of(row.estimator.family)}" {place}/>')
        parts.append(label(left + length + 5, y + 12, number(row.mean_rmse_deg)))
    texts = "; ".join(f"{row.name} {number(row.mean_rmse_deg)} deg" for row in rows)
    return drawing("bars", (left + width + 50, bottom + 20), "Mean angle error", texts, "".join(parts))


def _scatter(rows: list[Score]) -> str:
    timed = [row for row in rows if row.step_us > 0.0]
    ranges = [
        (10.0 ** math.floor(math.log10(min(v)) - 0.05), 10.0 ** math.ceil(math.log10(max(v)) + 0.05))
        for v in ([r.step_us for r in timed], [r.mean_rmse_deg for r in timed])
    ]
    logs = (math.log10(ranges[0][0]), math.log10(ranges[0][1]))
    panel = Panel(46, 8, 270, max(ROW * len(rows) - 12, 220), logs, ranges[1], log_y=True)
    bottom = panel.top + panel.height
    parts = []
    for power in range(round(logs[0]), round(logs[1]) + 1):
        x = float(panel.x(power))
        parts.append(f'<path class="grid" d="M{x:.1f} {panel.top}V{bottom:.1f}"/>')
        parts.append(label(x, bottom + 14, f"{10.0**power:g}", anchor="middle"))
    for power in range(round(math.log10(ranges[1][0])), round(math.log10(ranges[1][1])) + 1):
        y = float(panel.y(10.0**power))
        parts.append(f'<path class="grid" d="M{panel.left} {y:.1f}h{panel.width}"/>')
        parts.append(label(panel.left - 5, y + 4, f"{10.0**power:g}", anchor="end"))
    points = [(float(panel.x(math.log10(r.step_us))), float(panel.y(r.mean_rmse_deg)), r) for r in timed]
    parts += _names_at_right([(x, y, row.name) for x, y, row in points], panel)
    for x, y, row in points:
        parts.append(f'<circle class="{_style_of(row.estimator.family)}" cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>')
    texts = "; ".join(f"{r.name} {number(r.step_us)} µs, {number(r.mean_rmse_deg)} deg" for r in timed)
    return drawing("scatter", (440, bottom + 20), "Error over time per step", texts, "".join(parts))


LINE = 14.0


def _names_at_right(points: list[tuple[float, float, str]], panel: Panel) -> list[str]:
    """Names in a column beside the panel, with a line to each point, near its height and without overlap."""
    ordered = sorted(points, key=lambda point: (point[1], -point[0]))
    heights = [y for _, y, _ in ordered]
    for i in range(1, len(heights)):
        heights[i] = max(heights[i], heights[i - 1] + LINE)
    floor = panel.top + panel.height
    for i in reversed(range(len(heights))):
        heights[i] = min(heights[i], floor)
        floor = heights[i] - LINE
    edge = panel.left + panel.width + 12
    parts = []
    for (x, y, name), height in zip(ordered, heights, strict=True):
        parts.append(f'<path class="lead-line" d="M{x:.1f} {y:.1f}L{edge:.1f} {height:.1f}"/>')
        parts.append(label(edge + 4, height + 4, name, "strip-name"))
    return parts


def _numbers(found: Comparison) -> str:
    wins = found.wins
    columns = found.columns
    rows = []
    for row in found.scores:
        values = row.columns()
        cells = [_cell(name, values.get(name, math.nan), row.name in wins.get(name, ())) for name in columns]
        rows.append([escape(row.name), *cells])
    against = "truth" if found.reference == "truth" else found.reference
    caption = (
        f"RMSE against {against} without the first {found.start_s:g} s. Angles: mean and worst of the "
        f"{len(found.joints)} joints between the root and an inertial unit; positions in root axes, both sides "
        "together. With correct bands NEES is 1; a dash: the filter reports none. Bold: best, or within 2 % of the "
        "best. Times are processor time of the filter alone, for all "
        f"sensors of one instant, on {found.processor}; filters of ahrs run in Python."
    )
    return table("compared", caption, ["filter", *map(_head, columns)], rows)


def _head(name: str) -> str:
    plain = name.removesuffix("_mm").removesuffix("_rmse").removesuffix("_position").replace("_", " ")
    return _HEAD.get(name) or f"{plain}, mm"


def _cell(name: str, value: float, won: bool) -> str:
    if not math.isfinite(value):
        return DASH
    text = percent(value) if name == "coverage_95" else number(value, 5 if name == "correlation" else 3)
    return f"<b>{text}</b>" if won else text


def _what(found: Comparison) -> str:
    rows = [
        [
            breakable(row.name),
            escape(row.estimator.title),
            escape(row.estimator.assumes),
            escape(row.estimator.source),
        ]
        for row in found.scores
    ]
    return table(
        "estimators",
        "What each filter estimates and assumes, and its source.",
        ["filter", "is", "with", "after"],
        rows,
    )


def _notes(found: Comparison) -> str:
    texts = [f"{name} was not run: {why}" for name, why in found.left_out.items()]
    most = len(found.joints)
    partial = [row for row in found.scores if row.joints < most and not math.isnan(row.mean_rmse_deg)]
    texts += [f"{row.name}: {row.joints} of {most} joints estimated" for row in partial]
    texts.append(
        "Filters on single units are given the azimuth of the magnetic field, which the others estimate; they use no "
        "lengths, closures or base accelerations, and encoders are read directly."
    )
    return notes_list(texts)
