"""`crew_findings`: what stands out between the seats of a boat, at most three, and nothing that chance explains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from oarlock.rowing.crew.scatter import FEWEST, inflation
from oarlock.rowing.crew.timing import CrewTiming, Delay
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import NORMAL_95, f_tail

MOST = 3
LEAST_S = 0.005
"""Smaller differences are not named, however certain: the choice of this project, not a published limit."""
FALSE_SHARE = 0.03
"""Of crews without any difference, the share of which one is named; divided among all comparisons (Bonferroni)."""
_LEAST_RATIO = 1.4
_ORDER = {"catch": 0, "finish": 1, "drive": 2, "scatter": 3}


@dataclass(frozen=True)
class CrewFinding:
    """One thing that stands out.

    Attributes:
        kind: ``catch``, ``finish``, ``drive`` (a difference of means) or ``scatter`` (less even catches than
            the others').
        seats: whom it concerns; several where all follow the reference in the same way.
        size_s, low_s, high_s: difference to the reference with its 95 % band, s; of ``scatter`` the standard deviation.
        others_s: of ``scatter``: the standard deviation of the other seats, s; else NaN.
        finish_too: of ``catch``: the finish is as early or late, and is not named again.
    """

    kind: str
    seats: tuple[str, ...]
    size_s: float
    low_s: float
    high_s: float
    others_s: float = float("nan")
    finish_too: bool = False


def crew_findings(timing: CrewTiming) -> list[CrewFinding]:
    """The largest differences first, then scatter."""
    compared = ("catch", "finish") if timing.clocks.known else ("drive",)
    delays = [one for one in timing.delays if one.event in compared]
    tests = len(delays) + (len(timing.seats) if len(timing.seats) > 2 else 0)
    sure = 1.0 - FALSE_SHARE / max(tests, 1)
    named = [one for one in delays if _is_sure(one, sure)]
    found = [finding for event in compared for finding in _of_event(timing, event, named)]
    found.sort(key=lambda one: -abs(one.size_s))
    return (_merged(found) + _uneven(timing, 1.0 - sure))[:MOST]


def _is_sure(one: Delay, sure: float) -> bool:
    half = one.strokes.half_width(sure, one.systematic_s)
    return bool(abs(one.mean_s) > max(half, LEAST_S))


def _of_event(timing: CrewTiming, event: str, named: list[Delay]) -> list[CrewFinding]:
    """One finding a seat; one of all, if all others differ from a seat in one direction and not among each other."""
    own = [one for one in named if one.event == event]
    others = [one for one in timing.delays if one.event == event]
    if len(others) > 1 and len(own) == len(others) and timing.against != "crew mean":
        low, high = max(one.low_s for one in own), min(one.high_s for one in own)
        if low <= high:
            size = float(np.mean([one.mean_s for one in own]))
            ends = min(one.low_s for one in own), max(one.high_s for one in own)
            return [CrewFinding(event, tuple(one.seat for one in own), size, *ends)]
    return [CrewFinding(event, (one.seat,), one.mean_s, one.low_s, one.high_s) for one in own]


def _merged(found: list[CrewFinding]) -> list[CrewFinding]:
    """Without the finish of seats whose catch is named and as late: that is one thing, said once."""
    kept: list[CrewFinding] = []
    for one in sorted(found, key=lambda one: (_ORDER[one.kind], -abs(one.size_s))):
        same = [
            k
            for k, other in enumerate(kept)
            if other.seats == one.seats and other.low_s <= one.high_s and one.low_s <= other.high_s
        ]
        if same:
            kept[same[0]] = replace(kept[same[0]], finish_too=True)
        else:
            kept.append(one)
    return sorted(kept, key=lambda one: -abs(one.size_s))


def _uneven(timing: CrewTiming, chance: float) -> list[CrewFinding]:
    """Seats whose catches scatter more than those of the others, about the mean of the crew; from three seats on."""
    if len(timing.seats) < 3:
        return []
    late = timing.late_s["catch"][timing.complete]
    if len(late) < 4 * FEWEST:
        return []
    off = late - late.mean(axis=1, keepdims=True)
    off = off - off.mean(axis=0)
    count = np.array([len(off) / inflation(column) for column in off.T])
    noise = np.array([np.mean(seat.catch_std_s**2) for seat in timing.seats])
    seats = len(timing.seats)
    seen = np.maximum(off.var(axis=0, ddof=1) - (1.0 - 2.0 / seats) * noise - noise.sum() / seats**2, 1e-8)
    own = _own_variances(seen)
    found = []
    for k, seat in enumerate(timing.seats):
        rest = np.delete(np.arange(seats), k)
        p = f_tail(
            max(count[k] - 1.0, 1.0),
            max(float(count[rest].sum()) - len(rest), 1.0),
            float(seen[k] / seen[rest].mean()),
        )
        sd, others = float(np.sqrt(own[k])), float(np.sqrt(own[rest].mean()))
        if p < chance and sd > max(_LEAST_RATIO * others, LEAST_S):
            half = NORMAL_95 * sd / np.sqrt(2.0 * max(count[k] - 1.0, 1.0))
            found.append(CrewFinding("scatter", (seat.name,), sd, sd - half, sd + half, others))
    return sorted(found, key=lambda one: -one.size_s)


def _own_variances(seen: Floats) -> Floats:
    """Variance of each seat, (S,), from those of the residuals about the mean of all, which contains a share of each.

    With v the variances, those of the residuals are (1 - 2/S) v + sum(v) / S^2.
    """
    seats = len(seen)
    total = seen.sum() / (1.0 - 1.0 / seats)
    return np.asarray(np.maximum((seen - total / seats**2) / (1.0 - 2.0 / seats), 0.0))
