"""`write_crew_report`: the timing of a crew as one HTML file, and every stroke as CSV beside it."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.report import (
    Axis,
    Column,
    Front,
    KeyFigure,
    Mark,
    Point,
    Series,
    Trust,
    belief_markup,
    capital,
    course_chart,
    fixed,
    front_markup,
    grid,
    notes_list,
    plain_table,
    row_chart,
    shell,
)
from oarlock.rowing.crew.findings import LEAST_S, CrewFinding, crew_findings
from oarlock.rowing.crew.overlays import Overlay, crew_overlays
from oarlock.rowing.crew.timing import CrewTiming, Delay
from oarlock.rowing.strokes.signals import KINDS
from oarlock.storage.progress import Progress, mark, shown
from oarlock.storage.statistics import NORMAL_95
from oarlock.storage.write_file import write_file

MOVEMENTS = {
    "oars": ("oars", "the oar turns toward the bow", "the oar turns back"),
    "handle": ("handle", "the handle turns toward the rower", "the handle turns back"),
    "seat": ("seat", "the seat turns toward the bow", "the seat stops: legs down"),
    "trunk": ("trunk", "the trunk begins to swing back", "the trunk begins to swing forward"),
    "trunk_gyro": ("trunk", "the trunk begins to swing back", "the trunk begins to swing forward"),
}
"""Of each source: its name, and what counts as catch and as finish."""


def ms(seconds: float) -> str:
    """Milliseconds for people: a whole number, with one decimal below 10; a dash for NaN."""
    if not np.isfinite(seconds):
        return "\N{EN DASH}"
    value = 1e3 * seconds
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}"


def ms_band(low_s: float, high_s: float) -> str:
    """A band such as "8 to 20 ms": both ends alike, whole numbers if the upper end is 10 ms or more."""
    digits = 0 if 1e3 * max(abs(low_s), abs(high_s)) >= 9.95 else 1
    return f"{1e3 * low_s:.{digits}f} to {1e3 * high_s:.{digits}f} ms"


def label(name: str) -> str:
    """For people: "seat 3", "stroke", "bow"."""
    return f"seat {name}" if name.isdigit() else name


def reference(against: str) -> str:
    """What seats are compared with: "the mean of the crew", or a seat."""
    return "the mean of the crew" if against == "crew mean" else label(against)


def named(names: Sequence[str]) -> str:
    """A list: "bow, seat 2 and seat 3"."""
    shown = [label(name) for name in names]
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def did(timing: CrewTiming) -> str:
    """Seats, strokes and rate."""
    cycle = timing.end_s - timing.catch_s
    rate = 60.0 / np.nanmedian(cycle) if np.isfinite(cycle).any() else np.nan
    people = [
        f"{label(seat.name)} {seat.session['athlete']}" for seat in timing.seats if "athlete" in seat.session
    ]
    whom = f" ({', '.join(people)})" if people else ""
    at = f" at {rate:.1f} strokes per minute" if np.isfinite(rate) else ""
    return f"{len(timing.seats)} seats{whom} rowed {int(timing.complete.sum())} strokes together{at}."


def about(timing: CrewTiming) -> str:
    """Boat, day and place, as far as a seat's session names them."""
    sessions = [seat.session for seat in timing.seats]
    found = (next((one[key] for one in sessions if key in one), "") for key in ("boat", "date", "place"))
    return ", ".join(filter(None, found))


def finding(one: CrewFinding, against: str) -> str:
    """A finding as a sentence with its size and band."""
    whom = capital(named(one.seats))
    if one.kind == "scatter":
        return (
            f"{whom}: catches less evenly than the others. From stroke to stroke they scatter by {ms(one.size_s)} ms "
            f"(SD; 95 %: {ms_band(one.low_s, one.high_s)}), those of the other seats by {ms(one.others_s)} ms."
        )
    low, high = sorted((abs(one.low_s), abs(one.high_s)))
    band = f"95 %: {ms_band(low, high)}"
    than = reference(against)
    plural = len(one.seats) > 1
    if one.kind == "drive":
        way = "longer" if one.size_s > 0 else "shorter"
        return f"{whom}: the drive takes {ms(abs(one.size_s))} ms {way} than that of {than} ({band})."
    verb = {"catch": "catch" if plural else "catches", "finish": "finish" if plural else "finishes"}[one.kind]
    way = "after" if one.size_s > 0 else "before"
    too = "; the finish differs about as much" if one.finish_too else ""
    both = "" if not plural else ", all about equally"
    return f"{whom} {verb} {ms(abs(one.size_s))} ms {way} {than}{both} ({band}){too}."


def nothing(timing: CrewTiming) -> str:
    """What is said if nothing stands out: how small a difference would have been seen."""
    if not timing.clocks.known:
        return "No seat's drive is longer or shorter, and no seat less even, than chance explains."
    widths = [one.half_width_s for one in timing.delays if one.event in ("catch", "finish")]
    widest = max((width for width in widths if np.isfinite(width)), default=np.nan)
    if not np.isfinite(widest):
        return "Too few strokes belong together to compare the seats."
    return (
        "Nothing stands out: no seat differs by more than chance explains. The bands are at most "
        f"±{ms(widest)} ms; differences below {ms(LEAST_S)} ms are not named."
    )


def trust(timing: CrewTiming) -> Trust:
    """Whether it can be believed: clocks and movement."""
    parts = [timing.clocks.sentence]
    if timing.clocks.why:
        parts.append(f"Why: {timing.clocks.why}.")
    if timing.source not in ("oars", "handle"):
        parts.append(
            f"The {MOVEMENTS[timing.source][0]}s are compared, because not all seats measured an oar: blades may "
            "differ by up to 50 ms from this."
        )
    if timing.clocks.known:
        return Trust("good", (" ".join(parts),))
    remedy = "Put a unit named hull on each logger, or give --clock-ms if you know how well the clocks agree."
    return Trust("care", (" ".join(parts),), remedy)


def basis(timing: CrewTiming) -> list[str]:
    """How it was measured, for the folded section."""
    name, catch, finish = MOVEMENTS[timing.source]
    return [
        f"The movement compared is that of the {name} ({KINDS[timing.source].words}). Catch: {catch}. Finish: "
        f"{finish}. It is "
        "the reversal of the movement, not the moment at which the blade is covered.",
        "Strokes of two seats belong together if each catch is the nearest of the other, less than a quarter of "
        "a stroke "
        f"and 0.5 s apart. {timing.left_out} strokes of {label(timing.seats[timing.leader].name)} are missing "
        f"in at least one "
        "other seat; each seat is compared on the strokes that it has.",
        "Bands contain the scatter from stroke to stroke (neighbouring strokes resemble each other), the "
        "measurement of each "
        "reversal, 1 ms for sensors, and the clocks.",
        "A difference is named only if chance explains it in fewer than 3 % of crews without any difference, over all "
        f"comparisons of this page together, and if it is at least {ms(LEAST_S)} ms (our choice).",
        "We found no published usual value for the difference between seats in ms, so none is shown. BioRow "
        "(newsletter on "
        "seat synchronisation, 2024) reports that a lack of synchronisation adds inertial losses and that "
        "rowers who start "
        "later feel a lighter handle.",
        timing.clocks.sentence,
    ]


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
                escape(seat.session.get("athlete", "\N{EN DASH}")),
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
    # of all seats alike: where nearly all strokes are
    values = 1e3 * np.concatenate([timing.late_s[event].ravel() for event in ("catch", "finish")])
    low, high = np.nanpercentile(values, [0.5, 99.5])
    margin = max(0.1 * (high - low), 10.0)
    up = Axis("later", "ms", (float(low - margin), float(high + margin)))
    drawn = []
    for k, seat in enumerate(timing.seats):
        if timing.delay(seat.name, "catch") is None:
            continue
        series = []
        for event in ("catch", "finish"):
            late, std = 1e3 * timing.late_s[event][:, k], 1e3 * timing.late_std_s[event][:, k]
            series.append(Series(event, stroke, late, late - NORMAL_95 * std, late + NORMAL_95 * std))
        across = Axis("stroke", "", (0.0, len(stroke) + 1.0))
        drawn.append(row_chart(f"each-{k}", capital(label(seat.name)), series, across, up))
    return grid(drawn)


def overlay_charts(timing: CrewTiming, overlays: Sequence[Overlay]) -> str:
    """Mean courses over the leader's stroke; a crew of more than six is drawn in two halves."""
    drawn = []
    whole = timing.end_s - timing.catch_s
    finish = timing.seats[timing.leader].finish_s
    drive = float(np.median(finish - timing.seats[timing.leader].catch_s))
    across = Axis(
        f"from the catch of {label(timing.seats[timing.leader].name)} to the next", "%", (0.0, 100.0)
    )
    marks = [Mark(100.0 * drive / float(np.nanmedian(whole)), "finish")] if np.isfinite(whole).any() else []
    for one in overlays:
        name, unit, scale = _QUANTITIES[one.quantity]
        seats = list(one.mean)
        for k, part in enumerate(_parts(seats)):
            series = []
            for seat in part:
                mean, sd = scale * one.mean[seat], scale * one.sd[seat]
                ends = (mean - sd, mean + sd) if len(part) <= 2 else (None, None)
                series.append(Series(label(seat), one.percent, mean, *ends))
            key = f"overlay-{one.quantity}-{k}"
            drawn.append(course_chart(key, name, series, across, Axis("", unit), marks))
    return grid(drawn)


def _parts(seats: list[str]) -> list[list[str]]:
    """At most six lines a chart; the leader, the last, is in each."""
    if len(seats) <= 6:
        return [seats]
    rest, last = seats[:-1], seats[-1:]
    middle = (len(rest) + 1) // 2
    return [rest[:middle] + last, rest[middle:] + last]


def _with_band(one: Delay | None) -> str:
    if one is None:
        return "reference"
    if not math.isfinite(one.mean_s):
        return "\N{EN DASH}"
    return f"{1e3 * one.mean_s:+.1f} ± {1e3 * one.half_width_s:.1f}".replace("-", "\N{MINUS SIGN}")


def _median(values: np.ndarray) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else math.nan


HEADS = {
    "catch": "At the catch",
    "finish": "At the finish",
    "drive": "Length of the drive",
    "scatter": "Evenness",
}
FOLDED = ("each", "overlays", "who", "measured")


def write_crew_report(
    timing: CrewTiming,
    path: str | PathLike[str],
    title: str | None = None,
    *,
    progress: Progress = None,
) -> tuple[Path, Path]:
    """Write a page that works offline, and a CSV file with every stroke beside it.

    Args:
        timing: from `crew_timing`.
        path: the file to write, or an existing folder, which gets ``crew.html``. Missing parents are made.
        title: heading.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        The page and the CSV file.
    """
    target = Path(path)
    target = target / "crew.html" if target.is_dir() else target
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_suffix(".csv")
    with shown(progress, "writing the report") as told:
        page = crew_page(timing, title or "Crew: timing between seats", beside.name)
        mark(told, 1.0)
    write_file(target, page)
    write_file(beside, _csv(timing))
    return target, beside


def crew_page(timing: CrewTiming, title: str, csv_name: str) -> str:
    """The page as text."""
    than = reference(timing.against)
    unsure = shifted = ""
    if not timing.clocks.known:
        unsure = " The clocks are not known: only changes from stroke to stroke mean something."
        shifted = " Each seat is shifted so that the mean catches agree, because clocks are not known."
    each = (
        f'<p class="hint">Later than {than}, stroke by stroke. Bars: 95 % interval of the measurement.{unsure} '
        f"All numbers are in <code>{escape(csv_name)}</code> beside this page.</p>"
    )
    over = f'<p class="hint">Means over the strokes that belong together.{shifted}</p>'
    overlays = crew_overlays(timing)
    sections = [
        ("timing", "Catch and finish", timing_chart(timing) + timing_table(timing)),
        ("each", "Stroke by stroke", each + strokes_charts(timing)),
        ("overlays", "Over a stroke", over + overlay_charts(timing, overlays) if overlays else ""),
        ("who", "Who rowed", who_table(timing)),
        ("measured", "How it was measured", notes_list(basis(timing))),
    ]
    front = Front(
        did=did(timing),
        points=[Point(HEADS[one.kind], finding(one, timing.against)) for one in crew_findings(timing)],
        quiet=nothing(timing),
        figures=_figures(timing),
    )
    lead = belief_markup(trust(timing), "measured-in") + front_markup(front)
    heading = ": ".join(filter(None, (about(timing), title)))
    style = files("oarlock.rowing.report").joinpath("style.css").read_text("utf-8")
    return shell(heading, lead, [one for one in sections if one[2]], style=style, folded=FOLDED)


def _figures(timing: CrewTiming) -> list[KeyFigure]:
    figures = [KeyFigure("Strokes together", str(int(timing.complete.sum())), f"{len(timing.seats)} seats")]
    for event in ("catch", "finish") if timing.clocks.known else ():
        means = [one.mean_s for one in timing.delays if one.event == event]
        if timing.against != "crew mean":
            means.append(0.0)
        if np.isfinite(means).all():
            apart = f"{1e3 * np.ptp(means):.0f} ms"
            figures.append(KeyFigure(f"First to last at the {event}", apart, "difference of means"))
    scatter = [one.strokes.own_sd for one in timing.delays if one.event == "catch"]
    if np.isfinite(scatter).any():
        size = f"{1e3 * np.nanmedian(scatter):.0f} ms"
        figures.append(KeyFigure("Scatter at the catch", size, "SD of a stroke, median of seats"))
    worst = timing.clocks.worst_std_s
    told = "not known" if not timing.clocks.known else "0 ms" if worst == 0.0 else f"{ms(worst)} ms"
    of = {"one": "one logger", "unknown": "of the loggers"}.get(timing.clocks.kind, "SD")
    return [*figures, KeyFigure("Clocks", told, of)]


def _csv(timing: CrewTiming) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    names = [seat.name for seat in timing.seats]
    heads = [f"{name}_{event}_late_s" for event in ("catch", "finish") for name in names]
    writer.writerow(["stroke", "catch_time_s", *heads, *(f"{head}_std" for head in heads)])
    values = np.hstack([timing.late_s["catch"], timing.late_s["finish"]])
    stds = np.hstack([timing.late_std_s["catch"], timing.late_std_s["finish"]])
    for row, catch in enumerate(timing.catch_s):
        cells = [*values[row], *np.where(np.isfinite(values[row]), stds[row], np.nan)]
        writer.writerow([row + 1, f"{catch:.6f}", *("" if np.isnan(one) else f"{one:.6f}" for one in cells)])
    return text.getvalue()
