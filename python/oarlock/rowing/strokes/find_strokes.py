"""`find_strokes`: finds catch and finish times of a recording or track, with standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from oarlock.rowing.strokes.events import SideStroke, SideStrokes, Stroke, paired
from oarlock.rowing.strokes.kinds import stretches, told_apart
from oarlock.rowing.strokes.reversal_finder import ReversalFinder
from oarlock.rowing.strokes.reversals import Reversal
from oarlock.rowing.strokes.signals import KINDS, Signal, moving, signals_of
from oarlock.rowing.strokes.strokes import ZERO_STD, Strokes

if TYPE_CHECKING:
    from oarlock import Model, Recording, Track

_OAR = {"r": "right (port)", "l": "left (starboard)"}


def find_strokes(
    data: Track | Recording,
    *,
    source: str | None = None,
    model: Model | None = None,
    zero_std: float = ZERO_STD,
) -> Strokes:
    """Find all strokes from oar angles; without these from the seat, then from the trunk.

    A catch is a minimum of the movement and a finish a maximum. They are at least 30 deg apart (0.4 m of an ergometer's
    handle, 0.15 m of the seat, 15 deg of the trunk). A polynomial around each reversal gives its time
    (`rowing.strokes.reversals`).
    From seat or trunk alone some times are less accurate, which is included in their standard deviations.

    Args:
        data: a track, or a recording as it was made.
        source: `oars`, `handle`, `seat`, `trunk` (a track's) or `trunk_gyro` (a recording's unit `back`); None takes
            the first that is there.
        model: gives the mount of the unit on the back; without it the axis of largest rotation is used.
        zero_std: standard deviation of the encoders' zeros, rad or m.

    Raises:
        DataError: no signal from which strokes can be found.
    """
    signals, still = moving(signals_of(data, source, model))
    strokes = paired({signal.side: _side_strokes(signal) for signal in signals})
    told = told_apart(strokes, signals)
    start_s = min(float(signal.time_s[0]) for signal in signals)
    end_s = max(float(signal.time_s[-1]) for signal in signals)
    return Strokes(
        source=signals[0].source,
        strokes=tuple(strokes),
        kinds=told.kinds,
        paused=told.paused,
        left_out=told.left_out,
        stretches=stretches(strokes, told, start_s, end_s),
        zero_std=zero_std,
        notes=tuple(_notes(signals, strokes, still)),
        epoch=data.epoch or "",
    )


def _side_strokes(signal: Signal) -> list[SideStroke]:
    kind = KINDS[signal.source]
    finder, found = ReversalFinder(kind.least, kind.rests), SideStrokes(signal.source)
    for time_s, value in zip(signal.time_s.tolist(), signal.value.tolist(), strict=True):
        for reversal in finder.step(time_s, value):
            found.add(_with_rate(reversal, signal), finder.segment)
    for reversal in finder.finish():
        found.add(_with_rate(reversal, signal), finder.segment)
    return found.strokes()


def _with_rate(reversal: Reversal, signal: Signal) -> Reversal:
    """With what the velocity's own uncertainty moves the reversal by."""
    near = min(int(np.searchsorted(signal.time_s, reversal.time_s)), len(signal.time_s) - 1)
    if signal.rate_std[near] == 0.0 or np.isnan(reversal.curvature):
        return reversal
    moved = float(signal.rate_std[near]) / abs(reversal.curvature)
    std = float(np.hypot(reversal.time_std_s, moved))
    return Reversal(
        reversal.high, reversal.time_s, std, reversal.value, reversal.value_std, reversal.curvature
    )


def _notes(signals: Sequence[Signal], strokes: Sequence[Stroke], still: Sequence[Signal]) -> list[str]:
    kind = KINDS[signals[0].source]
    notes = []
    if signals[0].source not in ("oars", "handle"):
        notes.append(
            f"Strokes were found from {kind.words}: catch and finish are less accurate, see their standard deviations."
        )
    if signals[0].source == "oars" and len(signals) == 1 and signals[0].side:
        told = "moved" if still else "was measured; numbers and path of the other hand are left out"
        notes.append(f"Only the {_OAR[signals[0].side]} oar {told}.")
    notes += [f"The {_OAR[s.side]} oar never moved: its encoder may be broken. Check it." for s in still]
    if not strokes:
        notes.append(f"No stroke: {kind.words} never moved by {kind.least:.2g} {kind.unit} and back.")
    return notes
