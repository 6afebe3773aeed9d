"""The clocks that make a recording agree with its own track."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from oarlock.calibration import Calibration
from oarlock.clocks.delays import Delay
from oarlock.clocks.lines import after, line
from oarlock.clocks.pieces import Sight, Tracked, response, seen, spans
from oarlock.recording import Recording
from oarlock.stream_scales import Clock

Floats = NDArray[np.float64]
Clocks = dict[str, Clock]
Groups = Sequence[tuple[str, ...]]

_ROUGH_PIECES = 2
_PIECES = 6
_ROUNDS = 5
_SETTLED_S = 0.0015
"""Steps shrink to a third or less; this one is still taken."""
_NEAR_S = 0.004
"""Closer than this all pieces are used; the first steps do with a few."""
_OPEN_S = 0.05
"""Standard deviation of a delay before a window is looked at: what no row tells stays where it is."""
_SYSTEMATIC_S = {"all": {}, "others": {"gyro_rad_s": 0.004}}
_USUAL_S = 0.001
"""What bends a delay and does not scatter: a row never weighs more. A limb's turning that is told by its neighbours
alone is bent most."""


def settle(
    tracked: Tracked, recording: Recording, groups: Groups, anchored: bool, told: Callable[[float], object]
) -> Clocks:
    """The clock of each stream of the groups.

    Tracks pieces, sees how late each stream is against them, solves for the clocks through the response of the track
    to its own sensors, sets them right, and begins again until nothing moves (Gauss and Newton's method).

    Args:
        tracked: what delays are seen through.
        recording: stamps are within a tenth of a second of the truth.
        groups: streams that have one clock together.
        anchored: some other stream keeps true time; without one, only differences are told.
        told: called with the share done.
    """
    clocks = {name: Clock(0.0) for group in groups for name in group}
    felt: dict[Sight, Floats] = {}
    few = True
    for round_ in range(_ROUNDS):
        now = with_clocks(recording, clocks)
        pieces = spans(now, _ROUGH_PIECES if few else _PIECES)
        if not felt:
            felt = response(tracked, now, pieces[len(pieces) // 2], groups)
        tables = seen(tracked, now, pieces, list(clocks))
        steps = _steps(tables, groups, felt, anchored, clocks)
        clocks = {n: after(clocks[n], steps[g[0]]) for g in groups for n in g}
        middle = 0.5 * (now.start_s + now.end_s)
        moved = max(abs(c.offset_s + c.drift * middle) for c in steps.values())
        told((round_ + 1) / _ROUNDS)
        if moved < _SETTLED_S and not (few and len(pieces) == _ROUGH_PIECES):
            break
        few = few and moved > _NEAR_S
    return clocks


def with_clocks(recording: Recording, clocks: Mapping[str, Clock]) -> Recording:
    """The recording with stamps set right."""
    return Calibration(clocks=clocks).corrected(recording)


def _steps(
    tables: Sequence[Mapping[Sight, Sequence[Delay]]],
    groups: Groups,
    felt: Mapping[Sight, Floats],
    anchored: bool,
    so_far: Clocks,
) -> Clocks:
    points = []
    for table in tables:
        answers = {sight: _answer(sight, groups, felt, anchored) for sight in table}
        points += [_solved(t, window, answers, len(groups)) for t, window in _by_window(table).items()]
    if not points:
        return {group[0]: Clock(0.0, 0.0, np.inf, np.inf) for group in groups}
    time_s, delay, std = (np.array([p[k] for p in points]) for k in range(3))
    return {
        group[0]: line(time_s, delay[:, k], std[:, k], so_far[group[0]].drift)
        for k, group in enumerate(groups)
    }


def _answer(sight: Sight, groups: Groups, felt: Mapping[Sight, Floats], anchored: bool) -> Floats | None:
    """(clocks,) by how much a delay grows with each clock. Who is left out of a track moves his own delay alone."""
    if sight[0] == "all":
        return felt.get(sight)
    own = np.array([sight[1] in group for group in groups], dtype=np.float64)
    if anchored or len(groups) < 2:
        return own
    return np.asarray(own - (1.0 - own) / (len(groups) - 1))


def _by_window(table: Mapping[Sight, Sequence[Delay]]) -> dict[float, dict[Sight, Delay]]:
    found: dict[float, dict[Sight, Delay]] = {}
    for sight, windows in table.items():
        for window in windows:
            found.setdefault(round(window.time_s, 6), {})[sight] = window
    return found


def _solved(
    time_s: float, window: Mapping[Sight, Delay], answers: Mapping[Sight, Floats | None], count: int
) -> tuple[float, Floats, Floats]:
    """Delays of the clocks in one window, with standard deviations."""
    normal, right = np.eye(count) / _OPEN_S**2, np.zeros(count)
    for sight, delay in window.items():
        answer = answers[sight]
        if answer is not None:
            bent = _SYSTEMATIC_S[sight[0]].get(sight[2], _USUAL_S)
            weight = 1.0 / (delay.std_s**2 + bent**2)
            normal += weight * np.outer(answer, answer)
            right += weight * delay.delay_s * answer
    spread = np.linalg.inv(normal)
    return time_s, np.asarray(spread @ right), np.asarray(np.sqrt(np.diag(spread)))
