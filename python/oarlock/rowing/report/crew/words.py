"""Sentences of a crew's page: what was rowed, what stands out, and whether it can be believed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Trust, capital
from oarlock.rowing.crew.findings import LEAST_S, CrewFinding
from oarlock.rowing.crew.seats import CrewSeat
from oarlock.rowing.crew.timing import CrewTiming
from oarlock.rowing.strokes.signals import KINDS

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


def seat_about(seat: CrewSeat) -> str:
    """The athlete, or a dash."""
    return escape(seat.session.get("athlete", "\N{EN DASH}"))
