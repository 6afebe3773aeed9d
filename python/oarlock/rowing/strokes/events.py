"""Pairs reversals to catches and finishes, and joins those of two oars, for `find_strokes` and `LiveStrokes`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from oarlock.rowing.strokes.reversals import Reversal

PAIR_S = 0.2
"""Catches (or finishes) of two oars that are further apart belong to different strokes."""

# The seat reverses before the handle: 15 to 25 ms with good technique, up to 50 (Kleshnev's catch factor).
_SEAT_LEADS_S, _SEAT_LEADS_STD_S = 0.02, 0.025
# Legs are down at 80 to 90 % of the drive (BioRow's segment sequence; the arms' window is its last fifth).
_LEGS_DOWN_SHARE, _LEGS_DOWN_STD = 0.87, 0.07
# The trunk opens after the catch, while the legs already push; the delay depends on style.
_TRUNK_OPENS_S, _TRUNK_OPENS_STD_S = 0.11, 0.07
# The trunk reverses before or after the finish, also depending on style.
_TRUNK_TURNS_STD_S = 0.05


@dataclass(frozen=True)
class Event:
    """A catch or a finish of one signal: time and standard deviation, s."""

    time_s: float
    time_std_s: float
    reversal: Reversal


def catch_of(source: str, low: Reversal) -> Event:
    """The catch that corresponds to a minimum of this source."""
    shift, std = 0.0, 0.0
    if source == "seat":
        shift, std = _SEAT_LEADS_S, _SEAT_LEADS_STD_S
    elif source.startswith("trunk"):
        shift, std = -_TRUNK_OPENS_S, _TRUNK_OPENS_STD_S
    return Event(low.time_s + shift, float(np.hypot(low.time_std_s, std)), low)


def finish_of(source: str, high: Reversal, catch: Event) -> Event:
    """The finish that corresponds to a maximum of this source."""
    if source == "seat":
        drive_s = (high.time_s - catch.time_s) / _LEGS_DOWN_SHARE
        std = drive_s * _LEGS_DOWN_STD / _LEGS_DOWN_SHARE
        return Event(catch.time_s + drive_s, float(np.hypot(catch.time_std_s, std)), high)
    std = _TRUNK_TURNS_STD_S if source.startswith("trunk") else 0.0
    return Event(high.time_s, float(np.hypot(high.time_std_s, std)), high)


@dataclass(frozen=True)
class SideStroke:
    """A stroke of one signal; `end` is its next catch, None if none followed."""

    catch: Event
    finish: Event
    end: Event | None


@dataclass
class SideStrokes:
    """Strokes of one signal, built from its reversals in order of time."""

    source: str
    _events: list[tuple[str, Event, int]] = field(default_factory=list)

    def add(self, reversal: Reversal, segment: int) -> tuple[str, Event, bool] | None:
        """The event, and whether it replaces the previous one; None for a maximum without a preceding minimum."""
        before = self._events[-1] if self._events and self._events[-1][2] == segment else None
        if not reversal.high:
            kind, event = "catch", catch_of(self.source, reversal)
        else:
            low = self._low_before(segment)
            if low is None:
                return None
            kind, event = "finish", finish_of(self.source, reversal, low)
        replaces = before is not None and before[0] == kind
        if replaces:
            self._events.pop()
        self._events.append((kind, event, segment))
        return kind, event, replaces

    def _low_before(self, segment: int) -> Event | None:
        for kind, event, own in reversed(self._events[-2:]):
            if kind == "catch" and own == segment:
                return event
        return None

    def strokes(self) -> list[SideStroke]:
        """Every catch that has a finish."""
        found = []
        for place, (kind, event, segment) in enumerate(self._events[:-1]):
            then = self._events[place + 1]
            if kind != "catch" or then[0] != "finish" or then[2] != segment:
                continue
            last = self._events[place + 2] if place + 2 < len(self._events) else None
            end = last[1] if last is not None and last[0] == "catch" and last[2] == segment else None
            found.append(SideStroke(event, then[1], end))
        return found


@dataclass(frozen=True)
class Stroke:
    """A stroke of the boat: of each side "r" and "l" that took part, or of "" where there is one signal."""

    sides: Mapping[str, SideStroke]

    @property
    def catch(self) -> tuple[float, float]:
        """Time and standard deviation, s; mean of two oars."""
        return mean_event([stroke.catch for stroke in self.sides.values()])

    @property
    def finish(self) -> tuple[float, float]:
        """As `catch`."""
        return mean_event([stroke.finish for stroke in self.sides.values()])

    @property
    def end(self) -> tuple[float, float]:
        """As `catch`, for the next catch; NaN if none followed."""
        ends = [stroke.end for stroke in self.sides.values()]
        known = [end for end in ends if end is not None]
        return mean_event(known) if len(known) == len(ends) else (np.nan, np.nan)


def mean_event(events: Sequence[Event]) -> tuple[float, float]:
    """Mean time and its standard deviation, s."""
    std = float(np.sqrt(sum(event.time_std_s**2 for event in events))) / len(events)
    return float(np.mean([event.time_s for event in events])), std


def paired(sides: Mapping[str, Iterable[SideStroke]]) -> list[Stroke]:
    """Strokes of the boat in order of time; strokes of two oars that begin or end together are joined."""
    if len(sides) == 1:
        ((side, only),) = sides.items()
        return [Stroke({side: stroke}) for stroke in only]
    right, left = list(sides["r"]), list(sides["l"])
    found, used = [], set()
    starts = np.array([stroke.catch.time_s for stroke in left])
    for stroke in right:
        partner = _partner(stroke, left, starts)
        if partner is None or partner in used:
            found.append(Stroke({"r": stroke}))
        else:
            used.add(partner)
            found.append(Stroke({"r": stroke, "l": left[partner]}))
    found += [Stroke({"l": stroke}) for place, stroke in enumerate(left) if place not in used]
    return sorted(found, key=lambda stroke: stroke.catch[0])


def _partner(stroke: SideStroke, others: Sequence[SideStroke], starts: np.ndarray) -> int | None:
    place = int(np.searchsorted(starts, stroke.catch.time_s))
    near = [k for k in (place - 1, place, place + 1) if 0 <= k < len(others)]

    def apart(k: int) -> float:
        catches = abs(others[k].catch.time_s - stroke.catch.time_s)
        return min(catches, abs(others[k].finish.time_s - stroke.finish.time_s))

    best = min(near, key=apart, default=None)
    return best if best is not None and apart(best) <= PAIR_S else None
