"""Catch factor and finish factor: reversal times of seat and trunk relative to the handle."""

from __future__ import annotations

import numpy as np

from oarlock import Track
from oarlock.rowing.strokes.reversals import Reversal, fit_reversal
from oarlock.rowing.strokes.signals import slope_std
from oarlock.rowing.strokes.strokes import Strokes
from oarlock.storage.arrays import Floats

_SEARCH_S = 0.3
_REACH = {"seat": 0.04, "trunk": np.radians(4.0)}
_LEAST_READINGS = 8


def timing_factors(track: Track, strokes: Strokes) -> dict[str, tuple[Floats, Floats]]:
    """Columns `catch_factor_s` and `finish_factor_s` with standard deviations; NaN without a reversal."""
    if strokes.source not in ("oars", "handle"):
        return {}
    found = {}
    wanted = (("catch_factor_s", "seat", "catch"), ("finish_factor_s", "trunk", "finish"))
    for name, joint, event in wanted:
        if joint in track.coordinate_names:
            rows = [
                _behind(track, joint, time_s, std_s)
                for time_s, std_s in zip(
                    getattr(strokes, f"{event}_time_s"), getattr(strokes, f"{event}_time_std_s"), strict=True
                )
            ]
            values = np.array(rows, dtype=np.float64).reshape(-1, 2)
            found[name] = (values[:, 0], values[:, 1])
    return found


def _behind(track: Track, joint: str, time_s: float, std_s: float) -> tuple[float, float]:
    """How much later than this time the joint has its maximum, s, and the standard deviation."""
    turn = _turn(track, joint, time_s)
    return (
        (np.nan, np.nan) if turn is None else (turn.time_s - time_s, float(np.hypot(turn.time_std_s, std_s)))
    )


def _turn(track: Track, joint: str, time_s: float) -> Reversal | None:
    """Both the seat, forward at the catch, and the trunk, back at the finish, are at their largest there."""
    column = track.coordinate_names.index(joint)
    rows = slice(*np.searchsorted(track.time_s, [time_s - 2.0 * _SEARCH_S, time_s + 2.0 * _SEARCH_S]))
    times, values = track.time_s[rows], track.q[rows, column]
    near = np.flatnonzero(np.abs(times - time_s) <= _SEARCH_S)
    if len(near) < _LEAST_READINGS or not np.isfinite(values).all():
        return None
    top = near[int(np.argmax(values[near]))]
    turn = fit_reversal(times, values, float(times[top]), True, _REACH[joint])
    if turn is None or abs(turn.time_s - time_s) > _SEARCH_S:
        return None
    rate_std = float(slope_std(track.q_std[rows, column], track.qd_std[rows, column])[top])
    std = float(np.hypot(turn.time_std_s, rate_std / abs(turn.curvature)))
    return Reversal(True, turn.time_s, std, turn.value, turn.value_std, turn.curvature)
