"""`ExportPiece`: the strokes of another device as a piece without a track; how it held up, and where power was lost."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape

import numpy as np

from oarlock.report import Column, Section, fixed, plain_table
from oarlock.rowing.alongside.course import SpeedProfile, course_of
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, pace_text, slower_s
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.analysis.stroke_means import feature_means
from oarlock.rowing.findings.at_like_rate import change
from oarlock.rowing.findings.rowed import FEWEST_STROKES, Rowed
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, averages, feature_of
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread
from oarlock.rowing.report.tables import link
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats, Ints
from oarlock.storage.epoch import moment_text
from oarlock.storage.statistics import NORMAL_95

_NUMBERS = (
    "speed_m_s",
    "impeller_speed_m_s",
    "rate_per_min",
    "power_w",
    "mean_force_n",
    "peak_force_n",
    "curve_peak_force_n",
    "work_j",
    "arc_rad",
    "curve_arc_rad",
    "effective_arc_rad",
    "catch_angle_rad",
    "handle_travel_m",
    "heart_rate_per_min",
)
FORCES = ("mean_force_n", "peak_force_n", "curve_peak_force_n")
LENGTHS = ("effective_arc_rad", "arc_rad", "curve_arc_rad", "handle_travel_m")


@dataclass(frozen=True)
class Faded:
    """A number in the first and last quarter of the longest piece, SI and radians.

    Attributes:
        feature: what it is.
        first, last: means.
        change: last minus first.
        sd: standard deviation of the change.
        least: smallest size that matters.
    """

    feature: Feature
    first: float
    last: float
    change: float
    sd: float
    least: float

    @property
    def clear(self) -> bool:
        """Whether it is beyond its 95 % interval and large enough to matter."""
        return abs(self.change) > max(NORMAL_95 * self.sd, self.least)

    @property
    def percent(self) -> float:
        """The difference of both quarters, the effect of the rate included, in percent of the first."""
        return 100.0 * (self.last / self.first - 1.0) if self.first else float("nan")


def quarters(course: SpeedProfile) -> tuple[Ints, Ints]:
    """Rows of the first and of the last quarter of the longest piece after its start; empty if it is short."""
    rows = np.flatnonzero(course.longest.steady if course.longest else course.steady)
    count = len(rows) // 4
    return (rows[:count], rows[-count:]) if count >= FEWEST_STROKES else (rows[:0], rows[:0])


def faded_of(rowed: Rowed, course: SpeedProfile) -> dict[str, Faded]:
    """By column, of those with enough strokes in both quarters; `rowed` has the steady rows of the course."""
    place = np.cumsum(course.steady) - 1
    first, last = (place[rows] for rows in quarters(course))
    found = {}
    for name in _NUMBERS:
        if name not in rowed.columns or (name == "curve_peak_force_n" and "peak_force_n" in found):
            continue
        good = rowed.good(name)
        one = _faded(rowed, name, first[good[first]], last[good[last]])
        if one is not None:
            found[name] = one
    return found


def _faded(rowed: Rowed, name: str, first: Ints, last: Ints) -> Faded | None:
    """One number in two groups of strokes; None if too few have it."""
    feature, values = feature_of(name), rowed.columns[name]
    if min(len(first), len(last)) < FEWEST_STROKES:
        return None
    ends = (float(values[first].mean()), float(values[last].mean()))
    rows, later = np.concatenate([first, last]), np.repeat([False, True], [len(first), len(last)])
    watched = WATCHED.get(name)
    least = rowed.own(watched).least / feature.shown_scale if watched else 1.0
    between = change(values[rows], np.zeros(len(rows)), later, 1.0)
    sd = float(np.hypot(between.scatter_sd, rowed.shared_std(name)))
    return Faded(feature, *ends, ends[1] - ends[0], sd, least)


def fade_section(faded: dict[str, Faded], course: SpeedProfile) -> Section | None:
    """The table; None if the piece is too short."""
    if not faded:
        return None
    rows = []
    for name, one in faded.items():
        if name in SPEEDS:
            unit = f"as pace, {PER_500_M}"
            late, half = slower_s(one.last, one.first), of_pace(one.last, NORMAL_95 * one.sd)
            text = f"{'+' if late > 0.0 else ''}{fixed(late, 1)} {PLUS_MINUS} {fixed(half, 1)}"
            ends = [pace_text(one.first), pace_text(one.last)]
        else:
            unit = joined_unit(one.feature).strip()
            size = shown(one.feature, one.change, signed=True)
            text = f"{size} {PLUS_MINUS} {spread(one.feature, NORMAL_95 * one.sd)}"
            ends = [shown(one.feature, one.first), shown(one.feature, one.last)]
        told = f"<b>{escape(text)}</b>" if one.clear else f'<span class="mark">{escape(text)}</span>'
        rows.append([f"{link(name, one.feature.label)} <small>{escape(unit)}</small>", *ends, told])
    heads = [Column(name) for name in ("number", "first quarter", "last quarter", "change")]
    whose = "the longest piece" if len(course.stretches) > 1 else "the rowed part"
    whose += " after its start" if course.starts else ""
    caption = (
        f"Means of the first and last quarter of {whose}. Change {PLUS_MINUS} its 95 % interval; what the stroke rate "
        "does is in it. Bold: clear. Small: within its interval or too small to matter."
    )
    return Section(
        "fade", "From start to end", plain_table("fade-numbers", caption, heads, rows, style="splits")
    )


def where_lost(faded: dict[str, Faded], course: SpeedProfile) -> str:
    """Which of rate, force and length went down with power or speed; "" if neither fell clearly."""
    led = next((faded[k] for k in ("power_w", "speed_m_s", "impeller_speed_m_s") if k in faded), None)
    if led is None or not led.clear or led.change > 0.0:
        return ""
    parts = {
        word: faded[name]
        for word, names in (("rate", ("rate_per_min",)), ("force", FORCES), ("length", LENGTHS))
        for name in names[::-1]
        if name in faded
    }
    label = led.feature.label
    whose = " of the longest piece" if len(course.stretches) > 1 else ""
    start = f"From the first to the last quarter{whose} {label} fell by {abs(led.percent):.0f} %"
    told = ", ".join(
        f"{one.feature.label} {'+' if one.percent >= 0.5 else ''}{fixed(one.percent, 0)} %"
        for one in parts.values()
    )
    start += f" ({told})" if told else ""
    lost = {word: one for word, one in parts.items() if one.clear and one.change < 0.0}
    if not lost:
        return f"{start}."
    most = min(lost, key=lambda word: lost[word].percent)
    return f"{start}. Look at the {most} first: it went down most."


_MATTERS = 0.05
"""Share of a rower's own force, work or power from which a change matters; makers and references differ by more."""
_OF_FORCE = ("N", "J", "W")
_SCULLS = re.compile(r"\b[1248]x|scull|double|quad", re.IGNORECASE)
_SWEEPS = re.compile(r"\b[248][+-]|sweep|pair|eight", re.IGNORECASE)
_OAR = re.compile(r"\boar (\d+(?:\.\d+)?) cm")
_LONGEST_SCULL_CM = 330.0
"""Sculls are 2.8 to 2.95 m long, sweep oars 3.6 to 3.85 m."""


@dataclass(frozen=True)
class ExportPiece:
    """A table of strokes of another device.

    Attributes:
        table: the strokes.
        boat: the boat in the rower's words, such as "1x"; "" if it is not known.
    """

    table: StrokeTable
    boat: str = ""

    @property
    def name(self) -> str:
        """The file."""
        return self.table.source.partition(": ")[0]

    @property
    def date(self) -> str:
        """The day on which it begins; "" if unknown."""
        return moment_text(self.table.epoch)[:10]

    @property
    def device(self) -> str:
        """The device, such as "NK SpeedCoach"."""
        return device_of(self.table.source)

    @cached_property
    def course(self) -> SpeedProfile:
        """What was rowed when."""
        return course_of(self.table)

    @property
    def counted(self) -> Bools:
        """Which strokes count in averages, (N,): the rowed ones after the starts."""
        return self.course.steady

    @cached_property
    def kind(self) -> str:
        """Sculling, sweep or ergometer; "" if it is not known."""
        return boat_kind(self.table, self.boat)

    @cached_property
    def averages(self) -> dict[str, Average]:
        """Averages over the counted strokes. Their uncertainty is the scatter: a device's errors are not known."""
        known = {name: np.zeros(len(self.table)) for name in self.table.columns}
        return averages(self.table, feature_means(replace(self.table, stds=known), self.counted))

    @cached_property
    def rowed(self) -> Rowed:
        """For findings.

        Where strokes differ by less than the device's rounding, they share its error: it does not average out.
        """
        found = Rowed.of_table(self.table, self.counted, self.kind, self.device)
        steps = {name: resolution(values) for name, values in found.columns.items()}
        stds = {}
        for name in found.stds:
            known = found.columns[name][np.isfinite(found.columns[name])]
            shared = steps[name] / np.sqrt(12.0) if len(known) and known.std() < steps[name] else 0.0
            stds[name] = np.full(len(found.numbers), shared)
        least = {}
        for name, watched in WATCHED.items():
            if watched.feature.shown_unit in _OF_FORCE and name in found.columns and found.good(name).any():
                usual = abs(float(np.median(found.columns[name][found.good(name)])))
                least[name] = watched.feature.shown_scale * max(_MATTERS * usual, steps[name])
        return replace(found, stds=stds, least=least)

    @cached_property
    def faded(self) -> dict[str, Faded]:
        """First against last quarter, by column."""
        return faded_of(self.rowed, self.course)


def resolution(values: Floats) -> float:
    """The step to which a device rounds: the smallest difference between two of its numbers (N,); 0 without two."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9 * max(float(np.nanmax(np.abs(values))), 1e-12)] if len(steps) else steps
    return float(steps.min()) if len(steps) else 0.0


def device_of(source: str) -> str:
    """The device of an export's source, "FILE: DEVICE, what"."""
    return (source.partition(": ")[2] or source).partition(",")[0]


def boat_kind(table: StrokeTable, boat: str) -> str:
    """Sculling, sweep or ergometer; "" if neither the table nor the name of the boat says it.

    Ergometers measure the handle and no oar. NK's files have the length of the oar.
    """
    if "handle_travel_m" in table and "arc_rad" not in table:
        return "ergometer"
    if _SCULLS.search(boat):
        return "sculling"
    if _SWEEPS.search(boat):
        return "sweep"
    oar = next((found for note in table.notes if (found := _OAR.search(note))), None)
    return "" if oar is None else "sculling" if float(oar[1]) < _LONGEST_SCULL_CM else "sweep"
