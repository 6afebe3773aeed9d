"""Offset and drift between two loggers from a unit that each has on the hull. Used by `crew_clocks`.

Both units are on one stiff boat, so their accelerations along it are one signal. The rowers' own units would
not do: what they measure of the boat is mixed with the rower's movement, whose timing is what is asked.
"""

from __future__ import annotations

import numpy as np

from oarlock import Recording
from oarlock.recording import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.even_times import even_times
from oarlock.storage.statistics import robust_std

HULL_NAMES = ("hull", "boat")
"""Names of a unit on the hull."""
_RATE_HZ = 200.0
_WINDOW_S = 20.0
_NEAR_S = 0.15
_FEWEST_WINDOWS = 3
_LEAST_CORRELATION = 0.7
_SMOOTH_S = 0.05
# A peak as high one stroke further on would make the offset ambiguous.
_CLEAR = 0.03
_FLOOR_S = 0.001
"""Delays inside of a unit that no correlation shows; as `calibrate_clocks` has for an offset, of good units."""


class NoCommonMotion(Exception):
    """Says why two loggers cannot be aligned."""


def common_motion(
    leader: Recording, own: Recording, offset_s: float, search_s: float | None
) -> tuple[float, float, float]:
    """Offset in s, drift, and the offset's standard deviation in s, of `own` relative to `leader`.

    Args:
        leader: with a unit named as in `HULL_NAMES`.
        own: as `leader`, of the other logger.
        offset_s: where to search.
        search_s: how far from there; None searches everywhere.

    Raises:
        NoCommonMotion: no such unit, too short, or no clear agreement.
    """
    time_s, theirs = _along(leader)
    own_time_s, ours = _along(own)
    lag = _coarse(time_s, theirs, own_time_s, ours, offset_s, search_s)
    middles, lags = _windows(time_s, theirs, own_time_s, ours, lag)
    if len(lags) < _FEWEST_WINDOWS:
        raise NoCommonMotion(
            f"the hull's units agree in {len(lags)} stretches of {_WINDOW_S:.0f} s; {_FEWEST_WINDOWS} are needed"
        )
    return _line(middles, lags)


def _along(recording: Recording) -> tuple[Floats, Floats]:
    """Times and the acceleration along the unit's liveliest direction, evenly spaced."""
    name = next((name for name in HULL_NAMES if name in recording), None)
    stream = recording[name] if name is not None else None
    if not isinstance(stream, ImuStream) or stream.accel_m_s2 is None:
        raise NoCommonMotion("no unit on the hull (a stream named hull) with an accelerometer")
    good = np.isfinite(stream.accel_m_s2).all(axis=1)
    if good.sum() < 2:
        raise NoCommonMotion(f"the unit {name} has no readings")
    time_s, accel = stream.time_s[good], stream.accel_m_s2[good]
    even = even_times(time_s, 1.0 / _RATE_HZ, f"the unit {name}")
    readings = np.stack([np.interp(even, time_s, accel[:, k]) for k in range(3)], axis=1)
    readings -= readings.mean(axis=0)
    axis = np.linalg.svd(readings.T @ readings)[0][:, 0]
    width = int(_SMOOTH_S * _RATE_HZ) | 1
    return even, np.convolve(
        readings @ axis, np.hanning(width + 2)[1:-1] / np.hanning(width + 2).sum(), "same"
    )


def _coarse(
    time_s: Floats, theirs: Floats, own_time_s: Floats, ours: Floats, offset_s: float, search_s: float | None
) -> float:
    """The lag of the whole pieces; of either sign of the axis."""
    begin = own_time_s[0] - time_s[0]
    size = len(ours) + len(theirs) - 1
    both = np.abs(np.fft.irfft(np.fft.rfft(ours, size) * np.fft.rfft(theirs[::-1], size), size))
    lags = begin + np.arange(-(len(theirs) - 1), len(ours)) / _RATE_HZ
    if search_s is not None:
        near = np.abs(lags - offset_s) <= search_s
        both, lags = both[near], lags[near]
    if not len(both):
        raise NoCommonMotion("the recordings do not overlap in time")
    best = int(np.argmax(both))
    others = both[np.abs(lags - lags[best]) > 1.0]
    if len(others) and others.max() > (1.0 - _CLEAR) * both[best]:
        raise NoCommonMotion("the hull's units agree equally well one stroke further on")
    return float(lags[best])


def _windows(
    time_s: Floats, theirs: Floats, own_time_s: Floats, ours: Floats, lag: float
) -> tuple[Floats, Floats]:
    """Middles and lags of stretches in which both agree."""
    begin, end = max(time_s[0], own_time_s[0] - lag), min(time_s[-1], own_time_s[-1] - lag)
    tried = lag + np.arange(-_NEAR_S, _NEAR_S + 1e-9, 1.0 / _RATE_HZ)
    middles, lags = [], []
    for start in np.arange(begin + _NEAR_S, end - _WINDOW_S - _NEAR_S, _WINDOW_S):
        at = np.arange(start, start + _WINDOW_S, 1.0 / _RATE_HZ)
        here = np.interp(at, time_s, theirs)
        score = np.array(
            [abs(np.corrcoef(here, np.interp(at + one, own_time_s, ours))[0, 1]) for one in tried]
        )
        best = int(np.argmax(score))
        if score[best] >= _LEAST_CORRELATION and 0 < best < len(tried) - 1:
            before, peak, after = score[best - 1 : best + 2]
            step = 0.5 * (before - after) / (before - 2.0 * peak + after)
            middles.append(start + 0.5 * _WINDOW_S + tried[best])
            lags.append(tried[best] + step / _RATE_HZ)
    return np.array(middles), np.array(lags)


def _line(middles: Floats, lags: Floats) -> tuple[float, float, float]:
    """A line without the windows that are far off it; the standard deviation is that in the middle."""
    good = np.ones(len(lags), dtype=bool)
    for _ in range(3):
        slope, level = np.polyfit(middles[good], lags[good], 1)
        off = lags - level - slope * middles
        spread = robust_std(off[good]) + 1e-5
        good = np.abs(off) < 4.0 * spread
        if good.sum() < _FEWEST_WINDOWS:
            raise NoCommonMotion("the hull's units disagree from stretch to stretch")
    scatter = float(np.sqrt(np.sum(off[good] ** 2) / max(good.sum() - 2, 1)))
    # the lag is that at the seat's own stamp t: t - offset - drift t
    return float(level), float(slope), float(np.hypot(scatter / np.sqrt(good.sum()), _FLOOR_S))
