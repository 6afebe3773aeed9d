"""The section "Force" of an export without a track: where it is measured, its numbers, and its curves."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Axis, Column, Section, Series, course_chart, fixed, grid, plain_table
from oarlock.rowing.alongside.clock_match import Places
from oarlock.rowing.alongside.course import Course
from oarlock.rowing.alongside.force_curves import LABELS, ForceStack, force_stacks
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.export_fade import quarters
from oarlock.rowing.report.shown import joined_unit, shown, spread
from oarlock.rowing.report.tables import link
from oarlock.rowing.strokes.table import StrokeTable

_NUMBERS = (
    "peak_force_n",
    "curve_peak_force_n",
    "r_peak_gate_force_n",
    "l_peak_gate_force_n",
    "peak_gate_force_n",
    "mean_force_n",
    "peak_force_position_m",
    "peak_force_angle_rad",
    "peak_force_travel_rad",
    "work_j",
    "curve_work_j",
    "arc_rad",
    "effective_arc_rad",
    "slip_rad",
    "wash_rad",
    "handle_travel_m",
)
_FEWEST = 4
"""Strokes of a group with a curve of its own."""
BAND = "Tinted: SD, the standard deviation from stroke to stroke, to either side."
_PLACES = {"%": "of the drive", "m": "of handle travel", "s": "after the catch"}


def force_section(export: StrokeTable, course: Course) -> Section | None:
    """Forces and curves of the rowed strokes; None without any."""
    counted = np.flatnonzero(course.counted)
    stacks, table = force_stacks(export), _table(export, counted, course)
    if not stacks and not table:
        return None
    where = f"<p>{escape(_where(export))}</p>"
    if not stacks:
        missing = '<p class="hint">The export contains no force curves, only numbers for each stroke.</p>'
        return Section("force", "Force", where + table + missing)
    charts = [_chart(stack, course, f"force-{k}") for k, stack in enumerate(stacks)]
    said = " ".join(dict.fromkeys(stack.how for stack in stacks if stack.how))
    onset = f" A stroke begins with {export.onset}." if export.onset else ""
    hint = f"Means over the rowed strokes. {BAND} {said}{onset}"
    curves = f'{_peaks(stacks, counted)}{grid(charts)}<p class="hint">{escape(hint)}</p>'
    return Section("force", "Force", where + curves + table)


def _where(export: StrokeTable) -> str:
    """Where the force acts, and what the effective arc is."""
    device = export.source.partition(": ")[2]
    if device.startswith("NK"):
        told = (
            "The EmPower oarlock measures at the gate (the pin of the rigger), horizontally, one oar of one side "
            "(BioRow, 2017); NK's Logbook calls the numbers handle forces."
        )
    elif any("gate_force" in name for name in (*export.columns, *export.curves)):
        told = "The force is that at the gate (the pin of the rigger), of each oar."
    elif "arc_rad" in export:
        told = "The file does not name the place of the force: gate or handle."
    else:
        told = "The force is that at the handle, as the ergometer gives it."
    if "effective_arc_rad" in export:
        told += (
            " Arc: from catch to finish. Effective arc: the part with load on the blade, without slip (before the "
            "force passes 100 N in sculling, 200 N in sweep) and wash (after it has fallen below)."
        )
    if "peak_force_angle_rad" in export:
        told += (
            " Angle of peak force: 0° is the oar square to the boat, negative before it, towards the catch."
        )
    return told


def _table(export: StrokeTable, counted: Places, course: Course) -> str:
    """Means of forces, work and length, how far strokes differ, and the quarters."""
    held = [name for name in _NUMBERS if name in export and np.isfinite(export[name][counted]).any()]
    if not any(name.endswith("_force_n") for name in held):
        return ""
    first, last = quarters(course)
    rows = []
    for name in held:
        feature = feature_of(name)
        cells = [shown(feature, _mean(export[name][part])) for part in (counted, first, last)]
        scatter = f"SD {spread(feature, float(np.nanstd(export[name][counted])))}"
        label = f"{link(name, feature.label)} <small>{escape(joined_unit(feature).strip())}</small>"
        rows.append([label, cells[0], scatter, *cells[1:]])
    heads = [Column(name) for name in ("number", "mean", "stroke to stroke", "first quarter", "last quarter")]
    caption = "Means over the rowed strokes. Stroke to stroke: standard deviation of single strokes."
    return plain_table("force-numbers", caption, heads, rows, style="splits")


def _mean(values: np.ndarray) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def _chart(stack: ForceStack, course: Course, key: str) -> str:
    first, last = quarters(course)
    named = {"first quarter": first, "last quarter": last}
    if min(len(first), len(last)) < _FEWEST:
        named = {"all strokes": np.flatnonzero(course.counted)}
    series = [force_series(name, stack, rows) for name, rows in named.items()]
    return course_chart(
        key, LABELS[stack.name].capitalize(), series, Axis(stack.axis, stack.unit), Axis("", "N")
    )


def force_series(name: str, stack: ForceStack, rows: Places | None = None) -> Series:
    """The mean curve of some strokes with one standard deviation either side."""
    mean, sd = stack.mean_and_sd(rows)
    return Series(name, stack.at, mean, mean - sd, mean + sd)


def _peaks(stacks: Sequence[ForceStack], counted: Places) -> str:
    """A sentence on each curve's peak: its size and its place."""
    told = []
    for stack in stacks:
        chosen = stack.force_n[counted]
        chosen = chosen[np.isfinite(chosen).any(axis=1)]
        if not len(chosen):
            continue
        peak, place = np.nanmax(chosen, axis=1), stack.peak_at()[counted]
        digits = 0 if stack.unit == "%" else 2
        size, differs = (f"{fixed(float(of(peak)), 0)}" for of in (np.mean, np.std))
        at, varies = (f"{fixed(float(of(place)), digits)}" for of in (np.nanmean, np.nanstd))
        text = (
            f"{LABELS[stack.name].capitalize()}: the peak is {size} N (SD {differs} N from stroke to stroke)"
            f", at {at} {stack.unit} {_PLACES[stack.unit]} (SD {varies} {stack.unit})."
        )
        told.append(f"<p>{escape(text)}</p>")
    return "".join(told)
