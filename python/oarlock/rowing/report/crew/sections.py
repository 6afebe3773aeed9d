"""Tables and charts of a crew's page."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from oarlock.report import (
    Axis,
    Column,
    Mark,
    Series,
    capital,
    course_chart,
    fixed,
    grid,
    plain_table,
    row_chart,
)
from oarlock.rowing.crew.overlays import Overlay
from oarlock.rowing.crew.timing import CrewTiming, Delay
from oarlock.rowing.report.averages import SIGMAS_95
from oarlock.rowing.report.crew.words import label, ms, reference, seat_about

_QUANTITIES = {
    "oar": ("Oar angle", "deg", math.degrees(1.0)),
    "handle": ("Handle", "cm", 100.0),
    "seat": ("Seat position, toward the stern", "cm", 100.0),
    "trunk": ("Trunk, leaning back", "deg", math.degrees(1.0)),
}
_NAMES = {"catch": "catch", "finish": "finish", "drive": "length of the drive"}


def who_table(timing: CrewTiming) -> str:
    """Each seat with its athlete, strokes, rate, drive and length."""
    rows = []
    for seat in timing.seats:
        table = seat.strokes.table()
        good = seat.strokes.in_averages
        arc = table["arc_rad"] if "arc_rad" in table else np.full(len(good), np.nan)
        rows.append(
            [
                capital(label(seat.name)),
                seat_about(seat),
                str(len(seat.catch_s)),
                fixed(_median(table["rate_per_min"][good]), 1),
                fixed(_median(seat.finish_s - seat.catch_s), 2),
                fixed(math.degrees(_median(arc[good])), 1),
            ]
        )
    heads: list[str | Column] = [
        "seat",
        "athlete",
        "strokes",
        Column("rate", "1/min"),
        Column("drive", "s"),
        Column("arc of the oar", "deg"),
    ]
    return plain_table("who", "Medians over the strokes that count.", heads, rows)


def timing_table(timing: CrewTiming) -> str:
    """Mean differences with bands, scatter, and how often each seat is first."""
    rows = []
    for k, seat in enumerate(timing.seats):
        cells = [_with_band(timing.delay(seat.name, event)) for event in ("catch", "finish", "drive")]
        catch = timing.delay(seat.name, "catch")
        sd = catch.strokes.own_sd if catch is not None else math.nan
        first = timing.first_share[k]
        share = f"{100 * first:.0f} %" if math.isfinite(first) else "\N{EN DASH}"
        rows.append([capital(label(seat.name)), *cells, ms(sd), share])
    caption = (
        f"Later than {reference(timing.against)} (minus: earlier), ms; ±: 95 % band of the mean. "
        "Scatter: standard deviation of the difference at the catch from stroke to stroke, without the "
        "measurement's. First: share of strokes in which the seat is first at the catch."
    )
    heads: list[str | Column] = [
        "seat",
        Column("catch", "ms"),
        Column("finish", "ms"),
        Column("drive longer", "ms"),
        Column("scatter", "ms"),
        "first",
    ]
    return plain_table("timing", caption, heads, rows)


def timing_chart(timing: CrewTiming) -> str:
    """Mean difference of each seat with its band: catch and finish; the drive if the clocks are not known."""
    events = ("catch", "finish") if timing.clocks.known else ("drive",)
    place = {seat.name: k + 1 for k, seat in enumerate(timing.seats)}
    series = []
    for j, event in enumerate(events):
        own = [one for one in timing.delays if one.event == event]
        # side by side, so that neither hides the other
        at = np.array([float(place[one.seat]) for one in own]) + (
            0.16 * (j - 0.5) if len(events) > 1 else 0.0
        )
        mean, half = (
            1e3 * np.array([getattr(one, key) for one in own]) for key in ("mean_s", "half_width_s")
        )
        series.append(Series(_NAMES[event], at, mean, mean - half, mean + half))
    seats = f"seat: 1 is bow, {len(place)} is {label(timing.seats[-1].name)}"
    drawn = row_chart(
        "timing-chart",
        "Later or earlier" if timing.clocks.known else "Longer or shorter drive",
        series,
        Axis(seats, "", (0.5, len(place) + 0.5)),
        Axis("later" if timing.clocks.known else "longer", "ms", least=20.0),
    )
    return grid([drawn])


def strokes_charts(timing: CrewTiming) -> str:
    """A chart a seat: catch and finish of every stroke."""
    stroke = np.arange(1.0, len(timing.catch_s) + 1.0)
    span = _span(timing)
    drawn = []
    for k, seat in enumerate(timing.seats):
        if timing.delay(seat.name, "catch") is None:
            continue
        series = []
        for event in ("catch", "finish"):
            late, std = 1e3 * timing.late_s[event][:, k], 1e3 * timing.late_std_s[event][:, k]
            series.append(Series(event, stroke, late, late - SIGMAS_95 * std, late + SIGMAS_95 * std))
        drawn.append(
            row_chart(
                f"each-{k}",
                capital(label(seat.name)),
                series,
                Axis("stroke", "", (0.0, len(stroke) + 1.0)),
                Axis("later", "ms", span),
            )
        )
    return grid(drawn)


def overlay_charts(timing: CrewTiming, overlays: Sequence[Overlay]) -> str:
    """Mean courses over the leader's stroke; a crew of more than six is drawn in two halves."""
    drawn = []
    whole = timing.end_s - timing.catch_s
    finish = timing.seats[timing.leader].finish_s
    drive = float(np.median(finish - timing.seats[timing.leader].catch_s))
    marks = [Mark(100.0 * drive / float(np.nanmedian(whole)), "finish")] if np.isfinite(whole).any() else []
    for one in overlays:
        name, unit, scale = _QUANTITIES[one.quantity]
        seats = list(one.mean)
        for k, part in enumerate(_parts(seats)):
            series = [
                Series(
                    label(seat),
                    one.percent,
                    scale * one.mean[seat],
                    scale * (one.mean[seat] - one.sd[seat]) if len(part) <= 2 else None,
                    scale * (one.mean[seat] + one.sd[seat]) if len(part) <= 2 else None,
                )
                for seat in part
            ]
            drawn.append(
                course_chart(
                    f"overlay-{one.quantity}-{k}",
                    name,
                    series,
                    Axis(
                        f"from the catch of {label(timing.seats[timing.leader].name)} to the next",
                        "%",
                        (0.0, 100.0),
                    ),
                    Axis("", unit),
                    marks,
                )
            )
    return grid(drawn)


def _parts(seats: list[str]) -> list[list[str]]:
    """At most six lines a chart; the leader, the last, is in each."""
    if len(seats) <= 6:
        return [seats]
    rest, last = seats[:-1], seats[-1:]
    middle = (len(rest) + 1) // 2
    return [rest[:middle] + last, rest[middle:] + last]


def _span(timing: CrewTiming) -> tuple[float, float]:
    """Of all seats alike: where nearly all strokes are."""
    values = 1e3 * np.concatenate([timing.late_s[event].ravel() for event in ("catch", "finish")])
    low, high = np.nanpercentile(values, [0.5, 99.5])
    margin = max(0.1 * (high - low), 10.0)
    return float(low - margin), float(high + margin)


def _with_band(one: Delay | None) -> str:
    if one is None:
        return "reference"
    if not math.isfinite(one.mean_s):
        return "\N{EN DASH}"
    return f"{1e3 * one.mean_s:+.1f} ± {1e3 * one.half_width_s:.1f}".replace("-", "\N{MINUS SIGN}")


def _median(values: np.ndarray) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else math.nan
