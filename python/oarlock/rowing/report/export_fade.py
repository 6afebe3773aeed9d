"""How an export's piece held up: its first against its last quarter, and where power was lost."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np

from oarlock.report import Column, Section, fixed, plain_table
from oarlock.rowing.alongside.clock_match import Places
from oarlock.rowing.alongside.course import SpeedProfile
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, pace_text, slower_s
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.at_like_rate import change
from oarlock.rowing.findings.rowed import FEWEST_STROKES, Rowed
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import SIGMAS_95, feature_of
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread
from oarlock.rowing.report.tables import link

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
        return abs(self.change) > max(SIGMAS_95 * self.sd, self.least)

    @property
    def percent(self) -> float:
        """The difference of both quarters, the effect of the rate included, in percent of the first."""
        return 100.0 * (self.last / self.first - 1.0) if self.first else float("nan")


def quarters(course: SpeedProfile) -> tuple[Places, Places]:
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


def _faded(rowed: Rowed, name: str, first: Places, last: Places) -> Faded | None:
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
        label, unit, *cells, text = _as_pace(one) if name in SPEEDS else _as_is(one)
        told = f"<b>{escape(text)}</b>" if one.clear else f'<span class="mark">{escape(text)}</span>'
        rows.append([f"{link(name, label)} <small>{escape(unit)}</small>", *cells, told])
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


def _as_is(one: Faded) -> tuple[str, str, str, str, str]:
    """Label, unit, both quarters, and the change with its 95 % interval."""
    half = spread(one.feature, SIGMAS_95 * one.sd)
    change = f"{shown(one.feature, one.change, signed=True)} {PLUS_MINUS} {half}"
    ends = (shown(one.feature, one.first), shown(one.feature, one.last))
    return one.feature.label, joined_unit(one.feature).strip(), *ends, change


def _as_pace(one: Faded) -> tuple[str, str, str, str, str]:
    """The same of a speed as time for 500 m."""
    late, half = slower_s(one.last, one.first), of_pace(one.last, SIGMAS_95 * one.sd)
    change = f"{'+' if late > 0.0 else ''}{fixed(late, 1)} {PLUS_MINUS} {fixed(half, 1)}"
    return one.feature.label, f"as pace, {PER_500_M}", pace_text(one.first), pace_text(one.last), change


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
    if not parts:
        return f"{start}."
    told = ", ".join(f"{one.feature.label} {_signed(one.percent)} %" for one in parts.values())
    lost = {word: one for word, one in parts.items() if one.clear and one.change < 0.0}
    if not lost:
        return f"{start} ({told})."
    most = min(lost, key=lambda word: lost[word].percent)
    return f"{start} ({told}). Look at the {most} first: it went down most."


def _signed(percent: float) -> str:
    return f"{'+' if percent >= 0.5 else ''}{fixed(percent, 0)}"
