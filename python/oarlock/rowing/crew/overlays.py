"""`crew_overlays`: mean courses of each seat over the leader's stroke, on one clock, so that timing can be seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock import Recording, Track
from oarlock.recording import ScalarStream
from oarlock.rowing.crew.timing import CrewTiming
from oarlock.storage.arrays import Floats

POINTS = 101
_FEWEST = 3
_LONGEST_GAP_S = 0.1
_QUANTITIES = {
    "oar": (("r_oar_phi", "l_oar_phi"), ("oar_phi",)),
    "handle": (("handle",),),
    "seat": (("seat",),),
    "trunk": (("trunk",),),
}


@dataclass(frozen=True, eq=False)
class Overlay:
    """Mean courses of one quantity.

    Attributes:
        quantity: ``oar`` (horizontal angle, mean of both, rad), ``handle`` (m), ``seat`` (m) or ``trunk`` (lean, rad).
        percent: (POINTS,) of the leader's stroke; 0 is its catch.
        mean, sd: by seat, (POINTS,) each: mean and standard deviation over the strokes.
    """

    quantity: str
    percent: Floats
    mean: dict[str, Floats]
    sd: dict[str, Floats]


def crew_overlays(timing: CrewTiming) -> list[Overlay]:
    """Courses of every quantity that at least two seats have.

    If the clocks are not known, each seat is shifted so that its mean catch is the leader's, and only shapes compare.
    """
    percent = np.linspace(0.0, 100.0, POINTS)
    found = []
    for quantity, choices in _QUANTITIES.items():
        mean: dict[str, Floats] = {}
        sd: dict[str, Floats] = {}
        for k, seat in enumerate(timing.seats):
            course = _course(seat.data, choices)
            strokes = None if course is None else _strokes(timing, k, *course)
            if strokes is not None and len(strokes) >= _FEWEST:
                mean[seat.name], sd[seat.name] = strokes.mean(axis=0), strokes.std(axis=0, ddof=1)
        if len(mean) > 1:
            found.append(Overlay(quantity, percent, mean, sd))
    return found


def _strokes(timing: CrewTiming, place: int, time_s: Floats, value: Floats) -> Floats:
    """(M, POINTS): the seat's values over the leader's strokes, without those that contain a gap."""
    end_s, share = timing.end_s, np.linspace(0.0, 1.0, POINTS)
    whole = np.isfinite(end_s) & np.isfinite(timing.late_s["catch"][:, place])
    at = timing.catch_s[whole, None] + share * (end_s - timing.catch_s)[whole, None]
    own = timing.clocks.seats[place].own_s(at)
    after = np.clip(np.searchsorted(time_s, own), 1, len(time_s) - 1)
    tight = (time_s[after] - time_s[after - 1] <= _LONGEST_GAP_S) & (own >= time_s[0]) & (own <= time_s[-1])
    good = tight.all(axis=1)
    return np.asarray(np.interp(own[good], time_s, value))


def _course(data: Track | Recording, choices: tuple[tuple[str, ...], ...]) -> tuple[Floats, Floats] | None:
    for names in choices:
        parts = [part for name in names if (part := _one(data, name)) is not None]
        if parts:
            time_s = parts[0][0]
            return time_s, np.mean([np.interp(time_s, *part) for part in parts], axis=0)
    return None


def _one(data: Track | Recording, name: str) -> tuple[Floats, Floats] | None:
    if isinstance(data, Track):
        if name not in data.coordinate_names:
            return None
        column = data.coordinate_names.index(name)
        time_s, value = data.time_s, data.q[:, column]
    else:
        if name not in data or not isinstance(stream := data[name], ScalarStream):
            return None
        time_s, value = stream.time_s, stream.value
    good = np.isfinite(value)
    return (time_s[good], value[good]) if good.sum() > POINTS else None
