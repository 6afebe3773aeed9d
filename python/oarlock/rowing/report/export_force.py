"""The section "Force" of an export without a track: where it is measured, its numbers, and its curves."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Axis, Column, Section, Series, course_chart, fixed, grid, plain_table
from oarlock.rowing.alongside.course import SpeedProfile
from oarlock.rowing.alongside.force_curves import LABELS, ForceStack, force_stacks
from oarlock.rowing.findings.rowed import FEWEST_STROKES
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.definitions import is_empower
from oarlock.rowing.report.export_piece import quarters
from oarlock.rowing.report.shown import joined_unit, shown, spread
from oarlock.rowing.report.tables import link
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats, Ints

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
BAND = "Tinted: one standard deviation (SD) from stroke to stroke on either side."
_PLACES = {"%": "of the drive", "m": "of handle travel", "s": "after the catch"}


def force_section(export: StrokeTable, course: SpeedProfile) -> Section | None:
    """Forces and curves of the rowed strokes; None without any."""
    counted = np.flatnonzero(course.steady)
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
    hint = f"Means over the rowed strokes{after_start(course)}. {BAND} {said}{onset}"
    curves = f'{_peaks(stacks, counted)}{grid(charts)}<p class="hint">{escape(hint)}</p>'
    return Section("force", "Force", where + curves + table)


def _where(export: StrokeTable) -> str:
    """Where the force acts, in a sentence."""
    if is_empower(export):
        return (
            "The EmPower oarlock measures one oar, at the gate (the pin of the rigger); in sculling its force, work "
            "and power are those of both oars already, so do not double them (BioRow, 2017)."
        )
    if any("gate_force" in name for name in (*export.columns, *export.curves)):
        return "The force is that at the gate (the pin of the rigger), of each oar."
    if "arc_rad" in export:
        return "The file does not name the place of the force: gate or handle."
    return "The force is that at the handle, as the ergometer gives it."


def after_start(course: SpeedProfile) -> str:
    """What follows "the rowed strokes" where means leave out starts; "" without any."""
    starts = len(course.starts)
    return " after the starts" if starts > 1 else " after the start" if starts else ""


def _table(export: StrokeTable, counted: Ints, course: SpeedProfile) -> str:
    """Means of forces, work and length, how far strokes differ, and the quarters if the piece is long enough."""
    held = [name for name in _NUMBERS if name in export and np.isfinite(export[name][counted]).any()]
    if not any(name.endswith("_force_n") for name in held):
        return ""
    ends = [part for part in quarters(course) if len(part)]
    rows = []
    for name in held:
        feature, values = feature_of(name), export[name]
        label = f"{link(name, feature.label)} <small>{escape(joined_unit(feature).strip())}</small>"
        means = [shown(feature, _mean(values[part])) for part in (counted, *ends)]
        rows.append([label, means[0], spread(feature, _sd(values[counted])), *means[1:]])
    names = ("number", "mean", "SD", *(("first quarter", "last quarter") if ends else ()))
    caption = f"Means over the rowed strokes{after_start(course)}. SD: standard deviation of single strokes."
    table = plain_table("force-numbers", caption, [Column(name) for name in names], rows, style="splits")
    if ends:
        return table
    count = int((course.longest.steady if course.longest else course.steady).sum())
    whose = " of the longest piece" if len(course.stretches) > 1 else ""
    return table + (
        f'<p class="hint">The first and the last quarter are not compared: {count} strokes{whose} count, '
        f"and {4 * FEWEST_STROKES} are needed.</p>"
    )


def _sd(values: Floats) -> float:
    """From stroke to stroke; NaN of fewer than two."""
    known = values[np.isfinite(values)]
    return float(known.std(ddof=1)) if len(known) > 1 else float("nan")


def _mean(values: Floats) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def _chart(stack: ForceStack, course: SpeedProfile, key: str) -> str:
    first, last = quarters(course)
    named = {"first quarter": first, "last quarter": last}
    if min(len(first), len(last)) < _FEWEST:
        named = {"all strokes": np.flatnonzero(course.steady)}
    series = [force_series(name, stack, rows) for name, rows in named.items()]
    return course_chart(
        key, LABELS[stack.name].capitalize(), series, Axis(stack.axis, stack.unit), Axis("", "N")
    )


def force_series(name: str, stack: ForceStack, rows: Ints | None = None) -> Series:
    """The mean curve of some strokes with one standard deviation either side."""
    mean, sd = stack.mean_and_sd(rows)
    return Series(name, stack.at, mean, mean - sd, mean + sd)


def _peaks(stacks: Sequence[ForceStack], counted: Ints) -> str:
    """A sentence on each curve's peak: its size and its place."""
    told = []
    for stack in stacks:
        chosen = stack.force_n[counted]
        chosen = chosen[np.isfinite(chosen).any(axis=1)]
        if not len(chosen):
            continue
        peak, place = np.nanmax(chosen, axis=1), stack.peak_at()[counted]
        digits = 0 if stack.unit == "%" else 2
        size, differs = (fixed(float(of(peak)), 0) for of in (_mean, _sd))
        at, varies = (fixed(float(of(place)), digits) for of in (_mean, _sd))
        text = (
            f"{LABELS[stack.name].capitalize()}: the peak is {size} N (SD {differs} N from stroke to stroke)"
            f", at {at} {stack.unit} {_PLACES[stack.unit]} (SD {varies} {stack.unit})."
        )
        told.append(f"<p>{escape(text)}</p>")
    return "".join(told)
