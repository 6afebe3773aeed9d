"""The clocks that make a recording agree with its own track."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from oarlock.clocks.delays import Delay
from oarlock.clocks.lines import after, line
from oarlock.clocks.pieces import Span, Tracked, response, seen, spans, telling
from oarlock.recording import Recording
from oarlock.stream_scales import Clock

Floats = NDArray[np.float64]
Clocks = dict[str, Clock]

_ROUGH_PIECES = 3
_PIECES = 8
_ROUNDS = 8
_SETTLED_S = 0.001
_NEAR_S = 0.01
"""Closer than this all pieces are used; the first steps do with a few."""
_OPEN_S = 0.05
"""Standard deviation of a delay before a window is looked at: what no row tells stays where it is."""
_SYSTEMATIC_S = 0.001
"""A row never weighs more than this: what bends it does not scatter."""


def settle(
    tracked: Tracked, recording: Recording, groups: Sequence[tuple[str, ...]], told: Callable[[float], object]
) -> tuple[Clocks, Floats]:
    """Clocks of the first stream of each group, and the response of the last round.

    Tracks pieces, sees how late each stream is against them, solves for the clocks through the response of the track
    to its own sensors, sets them right, and begins again until nothing moves (Gauss and Newton's method).
    """
    clocks = {name: Clock(0.0) for group in groups for name in group}
    rows, matrix, few = telling(tracked.model, recording), None, True
    for round_ in range(_ROUNDS):
        now = with_clocks(recording, clocks)
        pieces = spans(now, _ROUGH_PIECES if few else _PIECES)
        if matrix is None:
            matrix = response(tracked, now, pieces[len(pieces) // 2], groups, rows)
            if matrix is None:
                matrix = np.eye(len(rows), len(groups))
        steps = _steps(seen(tracked, now, pieces, told), rows, groups, matrix)
        clocks = {n: after(clocks[n], steps[g[0]]) for g in groups for n in g}
        middle = 0.5 * (now.start_s + now.end_s)
        moved = max(abs(c.offset_s + c.drift * middle) for c in steps.values())
        told((round_ + 1) / _ROUNDS)
        if moved < _SETTLED_S and (not few or len(pieces) < _ROUGH_PIECES):
            break
        few = few and moved > _NEAR_S
    return clocks, matrix


def with_clocks(recording: Recording, clocks: Mapping[str, Clock]) -> Recording:
    """The recording with stamps set right."""
    from oarlock.calibration import Calibration

    return Calibration(clocks=clocks).corrected(recording)


def _steps(
    tables: Sequence[Mapping[str, Sequence[Delay]]],
    rows: Sequence[str],
    groups: Sequence[tuple[str, ...]],
    matrix: Floats,
) -> Clocks:
    points = [_solved(window, rows, matrix) for table in tables for window in _windows(table)]
    time_s = np.array([p[0] for p in points])
    delay, std = np.array([p[1] for p in points]), np.array([p[2] for p in points])
    return {group[0]: line(time_s, delay[:, k], std[:, k]) for k, group in enumerate(groups)}


def _windows(table: Mapping[str, Sequence[Delay]]) -> list[dict[str, Delay]]:
    found: dict[float, dict[str, Delay]] = {}
    for name, windows in table.items():
        for window in windows:
            found.setdefault(round(window.time_s, 6), {})[name] = window
    return list(found.values())


def _solved(window: Mapping[str, Delay], rows: Sequence[str], matrix: Floats) -> tuple[float, Floats, Floats]:
    """Delays of the clocks in one window, with standard deviations."""
    there = [k for k, name in enumerate(rows) if name in window]
    part = matrix[there]
    delay = np.array([window[rows[k]].delay_s for k in there])
    weight = np.array([1.0 / (window[rows[k]].std_s ** 2 + _SYSTEMATIC_S**2) for k in there])
    normal = part.T @ (weight[:, None] * part) + np.eye(matrix.shape[1]) / _OPEN_S**2
    found = np.linalg.solve(normal, part.T @ (weight * delay))
    time_s = next(iter(window.values())).time_s
    return time_s, found, np.sqrt(np.diag(np.linalg.inv(normal)))
