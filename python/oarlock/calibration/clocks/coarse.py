"""Coarse search for clock errors of tenths of a second, by correlating norms of readings. Precedes the fine search.

The norms of angular velocity and specific force do not depend on mounts. Norms of accelerometers peak at the same time
when the whole body is shaken or a sensor is tapped.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.arrays import Floats

LARGEST_S = 0.6
WORTH_S = 0.06
"""Smaller delays are left to the fine search: norms of different limbs do not peak simultaneously to this accuracy."""
_GRID_S = 0.02
_SMOOTH_S = 0.04
_SLOW_S = 0.5
_BETTER = 0.1
"""Least gain in correlation over zero lag, because the correlation peaks of different limbs are broad."""
_LEAST = 0.5
_LEAST_LATE = 0.7
"""Least correlation for a delay. Joints of one periodic movement turn in succession: with correct clocks their rates
correlate by up to 0.64 at lags of half a second."""


def coarse_delays(recording: Recording, fixed: Sequence[str]) -> dict[str, float]:
    """Delays, s, of the streams with a significant delay relative to the others. Other streams are omitted.

    Streams are hung on each other from the pair that is most alike on (a spanning tree), beginning at `fixed`.
    """
    shared = max(s.time_s[0] for s in recording), min(s.time_s[-1] for s in recording)
    grid = np.arange(shared[0] + LARGEST_S, shared[1] - LARGEST_S, _GRID_S)
    if len(grid) < 10.0 / _GRID_S:
        return {}
    signals = {s.name: _signals(s, shared) for s in recording}
    edges = []
    for a, b in combinations(recording.names, 2):
        if a in fixed and b in fixed:
            continue
        for kind in signals[a].keys() & signals[b].keys():
            edges.append((*_lag(signals[a][kind], signals[b][kind]), a, b))
    return _hung(sorted(edges, reverse=True), recording.names, fixed)


def _hung(
    edges: list[tuple[float, float, float, str, str]], names: Sequence[str], fixed: Sequence[str]
) -> dict[str, float]:
    """Delays along the tree of the strongest edges (Kruskal 1956)."""
    place = {name: (0 if name in fixed else index + 1, 0.0) for index, name in enumerate(names)}
    for strength, lag, gain, a, b in edges:
        (tree_a, at_a), (tree_b, at_b) = place[a], place[b]
        if tree_a == tree_b or strength < _LEAST:
            continue
        is_late = abs(lag) > WORTH_S and gain > _BETTER
        if is_late and strength < _LEAST_LATE:
            continue
        way = lag if is_late else 0.0
        if tree_a < tree_b:
            moved, step, into = tree_b, at_a + way - at_b, tree_a
        else:
            moved, step, into = tree_a, at_b - way - at_a, tree_b
        place = {n: (into, at + step) if tree == moved else (tree, at) for n, (tree, at) in place.items()}
    return {name: at for name, (_, at) in place.items() if at != 0.0}


def _signals(stream: Stream, shared: tuple[float, float]) -> dict[str, Floats]:
    """What a stream feels on an even grid, by kind; the slow part is taken away."""
    grid = np.arange(*shared, _GRID_S)
    if isinstance(stream, ImuStream):
        norms = {k: _on(grid, stream.time_s, v) for k, v in stream.values.items() if k != "mag_ut"}
        return {k: _fast(np.linalg.norm(v, axis=1)) for k, v in norms.items()}
    rates = np.gradient(_on(grid, stream.time_s, next(iter(stream.values.values()))), _GRID_S, axis=0)
    return {"gyro_rad_s": _fast(np.linalg.norm(rates, axis=1))}


def _on(grid_s: Floats, time_s: Floats, rows: Floats) -> Floats:
    rows = rows.reshape(len(rows), -1)
    there = np.isfinite(rows).all(axis=1)
    if np.count_nonzero(there) < 2:
        return np.zeros((len(grid_s), rows.shape[1]))
    even = np.stack([np.interp(grid_s, time_s[there], column[there]) for column in rows.T], axis=1)
    return np.asarray(gaussian_filter1d(even, _SMOOTH_S / _GRID_S, axis=0))


def _fast(signal: Floats) -> Floats:
    return np.asarray(signal - gaussian_filter1d(signal, _SLOW_S / _GRID_S))


def _lag(one: Floats, other: Floats) -> tuple[float, float, float]:
    """The highest correlation, by how much the other is late there, s, and the gain over no lag."""
    most = round(LARGEST_S / _GRID_S)
    middle = one[most:-most]
    lags = np.arange(-most, most + 1)
    found = np.array([_correlation(middle, other[most + k : len(other) - most + k]) for k in lags])
    best = int(np.argmax(found))
    return float(found[best]), float(lags[best] * _GRID_S), float(found[best] - found[most])


def _correlation(one: Floats, other: Floats) -> float:
    a, b = one - one.mean(), other - other.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
