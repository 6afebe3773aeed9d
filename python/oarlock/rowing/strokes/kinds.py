"""Classifies strokes as rowing, start, paddling or turn, finds pauses, and selects strokes for averages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.strokes.events import Stroke
from oarlock.rowing.strokes.signals import KINDS, Signal
from oarlock.storage.arrays import Bools, Floats

STILL_S = 1.2
"""The rower pauses if the hands are stationary for longer than this in a recovery, s."""
_LONGEST_CYCLE_S = 5.5
_LONG_CYCLE = 1.8
_PADDLING_CYCLE_S = 4.0
_SHORT_ARC = 0.75
_START_STROKES = 5
_START_ARC = 0.85
_START_CYCLE = 0.15
_UNEVEN = 0.6
_SHORTEST_PIECE_S = 10.0
_STILL_STEP_S = 0.05
_ODD_SD = 2.0
_ODD_LEAST = 0.05


@dataclass(frozen=True)
class StrokeInterval:
    """An interval of one kind: `rowing`, `start`, `paddling`, `turn` with strokes first to last, or a `pause`."""

    kind: str
    start_s: float
    end_s: float
    first: int
    strokes: int


@dataclass(frozen=True, eq=False)
class StrokeKinds:
    """For each stroke: its kind, whether a pause follows, and why it is excluded from averages ("" if it is not)."""

    kinds: tuple[str, ...]
    paused: Bools
    left_out: tuple[str, ...]


def told_apart(strokes: Sequence[Stroke], signals: Sequence[Signal]) -> StrokeKinds:
    """The kind of each stroke; strokes are in order of time."""
    arcs, cycles = _arcs(strokes), _cycles(strokes)
    usual_cycle = float(np.median(cycles[np.isfinite(cycles)])) if np.isfinite(cycles).any() else 3.0
    longest_s = max(_LONGEST_CYCLE_S, _LONG_CYCLE * usual_cycle)
    following = _to_next(strokes, signals)
    paused = np.array([gap > longest_s for gap in following], dtype=bool)
    for place, stroke in enumerate(strokes):
        if following[place] <= longest_s and _stood_still(
            stroke.finish[0], following[place], stroke, signals
        ):
            paused[place] = True
    cycles = np.where(paused, np.nan, cycles)
    usual = KINDS[signals[0].source].usual
    reference = max(usual, float(np.nanpercentile(arcs, 75))) if len(arcs) else usual
    kinds = _kinds(strokes, signals, arcs / reference, cycles, paused)
    return StrokeKinds(tuple(kinds), paused, tuple(_left_out(strokes, kinds, cycles, arcs, paused)))


def stretches(
    strokes: Sequence[Stroke], told: StrokeKinds, start_s: float, end_s: float
) -> tuple[StrokeInterval, ...]:
    """Consecutive strokes of one kind as intervals, with the pauses before, between and after them."""
    found: list[StrokeInterval] = []
    at = start_s
    place = 0
    while place < len(strokes):
        last = place
        while last + 1 < len(strokes) and told.kinds[last + 1] == told.kinds[place] and not told.paused[last]:
            last += 1
        first_s = strokes[place].catch[0]
        if first_s - at > STILL_S:
            found.append(StrokeInterval("pause", at, first_s, place, 0))
        goes_on = last + 1 < len(strokes) and not told.paused[last]
        at = strokes[last + 1].catch[0] if goes_on else _known_end(strokes[last], bool(told.paused[last]))
        found.append(StrokeInterval(told.kinds[place], first_s, at, place, last - place + 1))
        place = last + 1
    if end_s - at > (STILL_S if found else 0.0):
        found.append(StrokeInterval("pause", at, end_s, len(strokes), 0))
    return tuple(found)


def _known_end(stroke: Stroke, paused: bool) -> float:
    end = stroke.end[0]
    return stroke.finish[0] if paused or np.isnan(end) else end


def _arcs(strokes: Sequence[Stroke]) -> Floats:
    return np.array(
        [
            np.mean([s.finish.reversal.value - s.catch.reversal.value for s in stroke.sides.values()])
            for stroke in strokes
        ]
    )


def _cycles(strokes: Sequence[Stroke]) -> Floats:
    return np.array([stroke.end[0] - stroke.catch[0] for stroke in strokes])


def _to_next(strokes: Sequence[Stroke], signals: Sequence[Signal]) -> Floats:
    """From each catch to the next, whether or not the signal lasted; of the last to the end of the readings."""
    starts = np.array([stroke.catch[0] for stroke in strokes])
    return np.diff(starts, append=max(float(signal.time_s[-1]) for signal in signals))


def _stood_still(finish_s: float, to_next_s: float, stroke: Stroke, signals: Sequence[Signal]) -> bool:
    if signals[0].source not in ("oars", "handle"):
        return False
    least = KINDS[signals[0].source].least
    spans = [s for s in signals if s.side in stroke.sides]
    next_s = stroke.catch[0] + to_next_s
    return all(_longest_still(signal, finish_s, next_s, least / 6.0) > STILL_S for signal in spans)


def _longest_still(signal: Signal, start_s: float, end_s: float, band: float) -> float:
    """Longest time within a band of this width, s."""
    first, stop = np.searchsorted(signal.time_s, [start_s, end_s])
    every = max(1, round(_STILL_STEP_S / float(np.median(np.diff(signal.time_s)))))
    time_s, value = signal.time_s[first:stop:every], signal.value[first:stop:every]
    longest, begin = 0.0, 0
    for now in range(len(time_s)):
        while np.ptp(value[begin : now + 1]) > band:
            begin += 1
        longest = max(longest, float(time_s[now] - time_s[begin]))
    return longest


def _kinds(
    strokes: Sequence[Stroke],
    signals: Sequence[Signal],
    shares: Floats,
    cycles: Floats,
    paused: Bools,
) -> list[str]:
    kinds = ["turn" if _turns(stroke, signals) else "rowing" for stroke in strokes]
    for place in range(len(strokes)):
        if kinds[place] == "rowing" and (shares[place] < _SHORT_ARC or cycles[place] > _PADDLING_CYCLE_S):
            kinds[place] = "paddling"
    for begin, end in _groups(paused):
        if _from_standstill(strokes, signals, begin, paused):
            _mark_start(kinds, shares, cycles, begin, end)
    _spare_single_strokes(kinds, paused)
    return kinds


def _groups(paused: Bools) -> list[tuple[int, int]]:
    ends = [int(k) + 1 for k in np.flatnonzero(paused)]
    if not ends or ends[-1] != len(paused):
        ends.append(len(paused))
    return list(zip([0, *ends[:-1]], ends, strict=True))


def _from_standstill(strokes: Sequence[Stroke], signals: Sequence[Signal], begin: int, paused: Bools) -> bool:
    """Whether the group of strokes begins after a pause; a recording cut out of a piece does not."""
    if begin > 0 or not strokes:
        return bool(begin and paused[begin - 1])
    catch_s = strokes[0].catch[0]
    own = [s for s in signals if s.side in strokes[0].sides]
    least = KINDS[own[0].source].least
    return all(_longest_still(signal, -np.inf, catch_s + 0.3, least / 6.0) > STILL_S for signal in own)


def _mark_start(kinds: list[str], shares: Floats, cycles: Floats, begin: int, end: int) -> None:
    later = cycles[begin:end][np.isfinite(cycles[begin:end])]
    usual = float(np.median(later)) if len(later) else np.nan
    for place in range(begin, min(end, begin + _START_STROKES)):
        off = abs(cycles[place] / usual - 1.0) > _START_CYCLE or shares[place] < _START_ARC
        if kinds[place] == "turn" or (place > begin and not off):
            return
        kinds[place] = "start"


def _spare_single_strokes(kinds: list[str], paused: Bools) -> None:
    """A single unusual stroke within rowing is not paddling; it is excluded from averages as unusual."""
    for place in range(1, len(kinds) - 1):
        around = kinds[place - 1] == kinds[place + 1] == "rowing"
        if kinds[place] == "paddling" and around and not paused[place - 1 : place + 1].any():
            kinds[place] = "rowing"


def _turns(stroke: Stroke, signals: Sequence[Signal]) -> bool:
    """One oar rows, or far longer strokes than the other."""
    if len(signals) < 2:
        return False
    if len(stroke.sides) < 2:
        (missing,) = [s for s in signals if s.side not in stroke.sides]
        return bool(_heard(missing, stroke.catch[0], stroke.finish[0]))
    arcs = [s.finish.reversal.value - s.catch.reversal.value for s in stroke.sides.values()]
    return min(arcs) < _UNEVEN * max(arcs)


def _heard(signal: Signal, start_s: float, end_s: float) -> bool:
    first, stop = np.searchsorted(signal.time_s, [start_s, end_s])
    gaps = np.diff(signal.time_s[max(first - 1, 0) : stop + 1])
    return bool(stop - first > 3 and gaps.max(initial=0.0) < 0.3 * (end_s - start_s))


def _left_out(
    strokes: Sequence[Stroke], kinds: Sequence[str], cycles: Floats, arcs: Floats, paused: Bools
) -> list[str]:
    found = [
        "" if kind == "rowing" else f"{'a ' if kind in ('start', 'turn') else ''}{kind} stroke"
        for kind in kinds
    ]
    for place in range(len(strokes)):
        if not found[place] and (paused[place] or np.isnan(cycles[place])):
            found[place] = "no catch followed it"
    runs = _runs(kinds, paused)
    lasted = [strokes[end - 1].finish[0] - strokes[begin].catch[0] for begin, end in runs]
    for (begin, end), own_s in zip(runs, lasted, strict=True):
        if own_s < _SHORTEST_PIECE_S <= max(lasted):
            reason = f"its piece lasts {own_s:.0f} s, less than {_SHORTEST_PIECE_S:.0f} s"
            found[begin:end] = [before or reason for before in found[begin:end]]
        _odd_ones(found, cycles, arcs, begin, end)
    return found


def _runs(kinds: Sequence[str], paused: Bools) -> list[tuple[int, int]]:
    """Rowing strokes in a row: begin and end."""
    runs, begin = [], None
    for place, kind in enumerate(kinds):
        if kind == "rowing" and begin is None:
            begin = place
        stops = begin is not None and (kind != "rowing" or paused[place] or place == len(kinds) - 1)
        if begin is not None and stops:
            runs.append((begin, place + (kind == "rowing")))
            begin = None
    return runs


def _odd_ones(found: list[str], cycles: Floats, arcs: Floats, begin: int, end: int) -> None:
    for name, values in (("time", cycles), ("arc", arcs)):
        known = np.array([k for k in range(begin, end) if np.isfinite(values[k]) and not found[k]])
        if len(known) < 5:
            continue
        away = values[known] - _trend(known, values[known])
        limit = max(_ODD_SD * float(np.std(away)), _ODD_LEAST * float(np.median(values[known])))
        for k, off in zip(known, away, strict=True):
            if abs(off) > limit:
                found[k] = f"its {name} is {100.0 * off / values[k]:+.0f} % off its neighbours'"


def _trend(places: Floats, values: Floats) -> Floats:
    """Median of nine neighbours: a rate that is raised on purpose makes no stroke odd."""
    half = 4
    return np.array([np.median(values[max(k - half, 0) : k + half + 1]) for k in range(len(places))])
