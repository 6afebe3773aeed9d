"""Hinge angles without surprise: continuous over time, near the middle of the joint's range. `Track` uses it for `q`.

An angle and the same angle plus a full turn are one posture, so a filter may follow either. Every output of a track
reads `Track.q`, where this choice is made once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from oarlock.storage.arrays import Bools, Floats, Ints

if TYPE_CHECKING:
    from oarlock.model.description import JointDescription


TURN = 2.0 * np.pi
_ROUNDING_RAD = 1e-9
_MORE_SHARE, _MORE_RAD = 1.5, np.radians(45.0)
"""Limits are soft, so a hinge is reported only beyond this share of its range and this much more than it."""
_ADVICE = "The mounts or the model do not fit: run `oarlock calibrate motion`."


@dataclass(frozen=True)
class Hinge:
    """A hinge of a track.

    Args:
        name: the joint's name.
        column: its column in `Track.q`.
        middle_rad: middle of its limits.
        limits_rad: its soft limits; None if they allow a full turn, as those of a wheel do.
    """

    name: str
    column: int
    middle_rad: float
    limits_rad: tuple[float, float] | None


def hinges_of(joints: Sequence[JointDescription], coordinate_names: Sequence[str]) -> tuple[Hinge, ...]:
    """The hinges of the joints that a model describes."""
    found = []
    for joint in joints:
        if joint.kind == "hinge":
            low, high = joint.limits
            limits = (low, high) if high - low < TURN - _ROUNDING_RAD else None
            found.append(Hinge(joint.name, coordinate_names.index(joint.name), 0.5 * (low + high), limits))
    return tuple(found)


def placed(hinges: Sequence[Hinge], q: Floats, qd: Callable[[], Floats], time_s: Floats) -> Floats:
    """Coordinates (T, n) in which each hinge is near its middle; only full turns are added, in place.

    A wheel is continuous over the whole track, another hinge where the filter did not find the posture anew.

    Args:
        hinges: of the columns of `q`.
        q: (T, n) coordinates; NaN where not estimated.
        qd: makes the rates (T, n); only asked for if an angle jumps by more than half a turn.
        time_s: (T,) s.
    """
    for hinge in hinges:
        known = np.flatnonzero(np.isfinite(q[:, hinge.column]))
        if not known.size:
            continue
        angle = q[known, hinge.column]
        jumps, turns = _jumps(angle, partial(_rates, qd, known, hinge.column), time_s[known])
        if hinge.limits_rad is None:
            added = np.zeros(len(angle))
            added[jumps] = turns
            angle = angle - TURN * np.cumsum(added)
            jumps = jumps[:0]
        pieces = np.split(angle, jumps)
        q[known, hinge.column] = np.concatenate(
            [piece - TURN * _turns_away(piece, hinge.middle_rad) for piece in pieces]
        )
    return q


def _rates(qd: Callable[[], Floats], rows: Ints, column: int) -> Floats:
    return np.asarray(qd()[rows, column])


def _jumps(angle: Floats, rate: Callable[[], Floats], time_s: Floats) -> tuple[Ints, Floats]:
    """Rows at which the angle jumps by full turns that the rate does not explain, and the number of turns.

    The filter's angles are continuous, so it has found the posture anew there. A wheel at a low output rate turns by
    more than half a turn from row to row, and its rate explains that.
    """
    step = np.diff(angle)
    jumps = np.flatnonzero(np.abs(step) > np.pi)
    if not jumps.size:
        return jumps, np.zeros(0)
    speed = np.nan_to_num(rate())
    expected = 0.5 * (speed[jumps] + speed[jumps + 1]) * np.diff(time_s)[jumps]
    turns = np.round((step[jumps] - expected) / TURN)
    return jumps[turns != 0] + 1, turns[turns != 0]


def _turns_away(angle: Floats, middle_rad: float) -> float:
    """Full turns between the middle of the range and the angle: its median, or its begin if it turns all round."""
    typical = float(np.median(angle)) if np.ptp(angle) <= TURN else float(angle[0])
    return float(np.round((typical - middle_rad) / TURN))


def turn_notes(hinges: Sequence[Hinge], q: Floats, observed: Bools) -> tuple[str, ...]:
    """A sentence for each hinge with limits that turns further than it can where sensors determine it."""
    found = ((hinge, q[observed[:, hinge.column], hinge.column]) for hinge in hinges if hinge.limits_rad)
    notes = (_note(hinge, angle[np.isfinite(angle)]) for hinge, angle in found)
    return tuple(note for note in notes if note)


def without_turn_notes(notes: Sequence[str]) -> tuple[str, ...]:
    """The notes that do not come from `turn_notes`."""
    return tuple(note for note in notes if not note.endswith(_ADVICE))


def _note(hinge: Hinge, angle: Floats) -> str:
    low, high = hinge.limits_rad or (0.0, 0.0)
    turned, own = (float(np.ptp(angle)) if angle.size else 0.0), high - low
    if turned <= max(_MORE_SHARE * own, own + _MORE_RAD):
        return ""
    degrees = [f"{np.degrees(value):.0f}" for value in (turned, low, high)]
    return f"{hinge.name} turns through {degrees[0]} deg; its range is {degrees[1]} to {degrees[2]} deg. {_ADVICE}"


@dataclass(frozen=True)
class NotesOfRun:
    """Makes the notes of a run when they are first read, because those on hinges need the estimates.

    Args:
        known: notes that need no estimates.
        hinges: makes the notes on hinges.
    """

    known: tuple[str, ...]
    hinges: Callable[[], tuple[str, ...]]

    def __call__(self) -> tuple[str, ...]:
        """All notes, each once."""
        return tuple(dict.fromkeys((*self.known, *self.hinges())))
