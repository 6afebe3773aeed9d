"""Detects stuck signals (constant during motion) and clipped signals (at the end of the range), for `plausibility`."""

from __future__ import annotations

from math import radians

import numpy as np

from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Bools, Floats

STUCK_S, STUCK_ROWS = 0.5, 20
"""A constant value over this time and this number of samples is stuck if the sensor moves."""
MOVES = {"gyro_rad_s": 0.1, "accel_m_s2": 0.3}
"""Standard deviation above which a unit moves."""
FLAT_ROWS, FLAT_SHARE = 3, 4
"""A flat top has at least 3 equal samples in a row; all flat tops together have at least 4."""
STEEP = 5.0
"""A clipped signal enters its flat top by a step of at least this many resolution steps; a resting one does not."""
NEAR = 0.04
_RANGES = {
    "gyro_rad_s": [(f"{x} deg/s", radians(x)) for x in (125, 250, 500, 1000, 2000, 4000)],
    "accel_m_s2": [(f"{x} g", x * 9.80665) for x in (2, 4, 6, 8, 16, 24, 32)],
}
_SENSOR = {"gyro_rad_s": "gyroscope", "accel_m_s2": "accelerometer"}


def stuck_texts(stream: ImuStream, others_move: bool) -> list[str]:
    """One sentence for each quantity whose axes keep one value for half a second while the unit moves."""
    if len(stream) < STUCK_ROWS:
        return []
    runs = {
        name: [_longest(column[1:] == column[:-1]) for column in rows.T]
        for name, rows in stream.values.items()
    }
    if others_move and _whole(stream, runs):
        first = max(first for own in runs.values() for first, _ in own)
        stop = min(stop for own in runs.values() for _, stop in own)
        when = (
            f"from {stream.time_s[first]:.2f} to {stream.time_s[stop - 1]:.2f} s"
            if first < stop
            else "for a while"
        )
        return [
            f"looks stuck: all readings are identical {when}, unlike those of a working sensor. Check its connection."
        ]
    texts = []
    for name, own in runs.items():
        held = [axis for axis, (first, stop) in enumerate(own) if _is_long(stream, first, stop)]
        # A quantity that is zero throughout has a finding of its own.
        if not held or not stream.values[name].any():
            continue
        first, stop = own[held[0]]
        if not _moves(stream, first, stop, name, held):
            continue
        which = "all axes" if len(held) == 3 else " and ".join("xyz"[axis] for axis in held)
        values = ", ".join(f"{stream.values[name][first, axis]:.5g}" for axis in held)
        texts.append(
            f"{name} looks stuck: {which} read {values} from {stream.time_s[first]:.2f} to "
            f"{stream.time_s[stop - 1]:.2f} s while the rest moves. Check the sensor; until then leave it out."
        )
    return texts


def clipped_texts(stream: ImuStream) -> list[str]:
    """One sentence for each quantity whose largest values form flat tops at one level."""
    texts = []
    for name, ranges in _RANGES.items():
        rows = stream.values.get(name)
        if rows is None or len(rows) < STUCK_ROWS:
            continue
        ends = [
            end for column in rows.T for end in (_flat_top(column), _flat_top(-column)) if end is not None
        ]
        if not ends:
            continue
        count, level = sum(n for n, _ in ends), max(value for _, value in ends)
        guess = [text for text, value in ranges if abs(level / value - 1.0) < NEAR]
        range_text = f", the end of a range of {guess[0]}" if guess else ""
        texts.append(
            f"{name} looks clipped: {count} readings are limited to {level:.4g}{range_text}. "
            f"Set the {_SENSOR[name]} to a larger range."
        )
    return texts


def moves(stream: ImuStream) -> bool:
    """True if the unit moved at any time."""
    return _moves(stream, 0, len(stream), "", [])


def _moves(stream: ImuStream, first: int, stop: int, name: str, held: list[int]) -> bool:
    for field, least in MOVES.items():
        rows = stream.values.get(field)
        if rows is None:
            continue
        kept = [axis for axis in range(3) if field != name or axis not in held]
        part = rows[first:stop, kept]
        part = part[np.isfinite(part).all(axis=1)]
        if len(part) > 1 and part.size and float(part.std(axis=0).max()) > least:
            return True
    return False


def _whole(stream: ImuStream, runs: dict[str, list[tuple[int, int]]]) -> bool:
    return all(_is_long(stream, first, stop) for own in runs.values() for first, stop in own)


def _is_long(stream: ImuStream, first: int, stop: int) -> bool:
    return stop - first >= STUCK_ROWS and stream.time_s[stop - 1] - stream.time_s[first] >= 0.99 * STUCK_S


def _longest(same: Bools) -> tuple[int, int]:
    """Start and stop index of the longest run of equal values, from where each equals the next."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    if not edges.size:
        return 0, 1
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best]) + 1


def _flat_top(column: Floats) -> tuple[int, float] | None:
    """Number of readings in flat tops at the largest value, and that value."""
    there = column[np.isfinite(column)]
    if not there.size or (top := float(there.max())) <= 0.0:
        return None
    at_top = column == top
    count = int(at_top.sum())
    first, stop = _longest(at_top[1:] & at_top[:-1])
    if count < FLAT_SHARE or stop - first < FLAT_ROWS or count > len(there) // 2:
        return None
    levels = np.unique(there)
    quantum = float(np.diff(levels).min())
    enters = np.flatnonzero(at_top[1:] & ~at_top[:-1])
    jumps = top - column[enters]
    jumps = jumps[np.isfinite(jumps)]
    steep = jumps.size and float(np.median(jumps)) > max(STEEP * quantum, 0.01 * top)
    return (count, top) if steep else None
