"""Fine search of `calibrate_clocks`: iterates until the filter's innovations no longer correlate with clock errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from oarlock.calibration.clocks.lines import CRYSTAL_DRIFT, after, line, usual_drift, usual_scatter
from oarlock.calibration.clocks.scores import Filtering, Span, spans
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock

Clocks = dict[str, Clock]

_ROUGH_PIECES = 2
_PIECES = 6
_ROUNDS = 8
_SETTLED_S = 0.0003
SAME_CLOCK_STDS = 3.0
"""Streams that share their stamps to the bit mostly share a clock; one is moved only where it is this clearly off."""
_NEAR_S = 0.003
"""Closer than this all pieces are used; the first steps do with a few."""


def settle(seen_by: Filtering, recording: Recording, progress: Callable[[float], object]) -> Clocks:
    """The clock of each stream of the groups.

    Looks at pieces, lays a line through each clock's delays, sets the stamps right, and begins again until no clock
    moves (Gauss and Newton's method).

    Args:
        seen_by: what delays are seen through.
        recording: stamps are within a tenth of a second of the truth.
        progress: called with the share done.
    """
    groups = seen_by.groups
    clocks = {name: Clock(0.0) for group in groups for name in group}
    one_clock = len({s.time_s.tobytes() for s in recording}) == 1
    few = not one_clock
    for round_ in range(_ROUNDS):
        now = with_clocks(recording, clocks)
        pieces = spans(now, _ROUGH_PIECES if few else _PIECES)
        steps = _steps(seen_by, now, pieces, clocks)
        progress((round_ + 1) / _ROUNDS)
        if not steps and few:
            few = False
            continue
        if not steps:
            return {name: Clock(0.0, 0.0, np.nan, np.nan) for name in clocks}
        clocks = {n: after(clocks[n], steps[g[0]]) for g in groups for n in g}
        middle = 0.5 * (now.start_s + now.end_s)
        moved = {name: abs(c.offset_s + c.drift * middle) for name, c in steps.items()}
        # Stamps that are all the same are set apart only for a good reason: together they give most information.
        least = {n: SAME_CLOCK_STDS * c.offset_std_s if one_clock else _SETTLED_S for n, c in steps.items()}
        if all(moved[n] < least[n] for n in moved) and not (few and len(pieces) == _ROUGH_PIECES):
            break
        few = few and max(moved.values()) > _NEAR_S
        one_clock = False
    return clocks


def with_clocks(recording: Recording, clocks: Mapping[str, Clock]) -> Recording:
    """The recording with time stamps corrected by these clocks."""
    return Calibration(clocks=clocks).corrected(recording)


def _steps(seen_by: Filtering, recording: Recording, pieces: list[Span], so_far: Clocks) -> Clocks:
    seen = seen_by.sights(recording, pieces)
    if not seen:
        return {}
    time_s = np.array([s.time_s for s in seen])
    delay, std = (np.array([getattr(s, key) for s in seen]) for key in ("delay_s", "std_s"))
    usual = usual_scatter(time_s, delay, std)

    def lines(drift_std: float) -> Clocks:
        return {
            g[0]: line(time_s, delay[:, k], std[:, k], so_far[g[0]].drift, usual=usual, drift_std=drift_std)
            for k, g in enumerate(seen_by.groups)
        }

    first = lines(CRYSTAL_DRIFT)
    return lines(usual_drift(after(so_far[name], clock) for name, clock in first.items()))
