"""Offset and drift between two clocks from the onsets of the same strokes, for `align_strokes`.

The sequences are matched by their intervals: an offset is good if onsets coincide more closely than intervals between
strokes differ. Missing and extra strokes are normal. If all intervals are alike, several offsets are as likely, which
`ClockMatch.rivals_s` says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Floats, Ints

FEWEST_PAIRS = 8
"""With fewer common strokes too many offsets fit by chance."""
FEWEST_SHARE = 0.25
"""Of the shorter sequence: smaller overlaps are not considered."""
MOST_DRIFT = 300e-6
"""Searched on either side. Quartz clocks differ by about 20e-6 (two sensors, polar-ble-sdk issue 674)."""
DRIFT_STD = 50e-6
DRIFT_SPAN_S = 120.0
"""In less time, a drift below `MOST_DRIFT` moves no onset by more than 20 ms about the middle."""
SURE = 10.0
"""Log-likelihood by which the best offset exceeds all others. Errors of neighbouring strokes are related, so it is well
above the 5 that 150:1 would need."""
_BIN_S = 0.04
_CANDIDATES = 40
_LEAST_STD_S = 0.004
_MISSING = 3.0
"""Cost of a stroke that only one sequence has, in log-likelihood: one in twenty."""
_MISSING_ALIKE = 1.0
"""The same where offsets are told apart: regular strokes that both devices missed by chance must not decide."""
_RESOLUTIONS_S = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class ClockMatch:
    """A clock's relation to the track's: track = device + `offset_s` + `drift` * (device - `middle_s`).

    Attributes:
        offset_s: at `middle_s` of the device's clock.
        drift: how much faster the track's clock runs, as a share; 0 for short pieces.
        middle_s: of the device's clock.
        offset_std_s: standard deviation of the offset, with the resolution of the device's stamps.
        drift_std: standard deviation of the drift.
        apart_std_s: standard deviation of single onsets about the relation.
        pairs: (K, 2) places in the device's and the track's sequence.
        rivals_s: other offsets that are about as likely; empty if the offset is unambiguous.
    """

    offset_s: float
    drift: float
    middle_s: float
    offset_std_s: float
    drift_std: float
    apart_std_s: float
    pairs: Ints
    rivals_s: tuple[float, ...] = ()

    def on_track(self, device_s: Floats) -> Floats:
        """Times of the device's clock on the track's."""
        return np.asarray(device_s + self.offset_s + self.drift * (device_s - self.middle_s))

    def std_s(self, device_s: Floats) -> Floats:
        """Standard deviation of `on_track`, without the error of single onsets."""
        return np.asarray(np.hypot(self.offset_std_s, self.drift_std * (device_s - self.middle_s)))


@dataclass(frozen=True)
class _Candidate:
    match: ClockMatch
    support: float
    """Log-likelihood against onsets at random times; grows with the overlap."""
    unmatched: int

    def closeness(self, pairs: int) -> float:
        """Log-likelihood of so many pairs, whatever the overlap."""
        return -pairs * math.log(self.match.apart_std_s) - _MISSING_ALIKE * self.unmatched


def match_clocks(device_s: Floats, track_s: Floats, near_s: float | None = None) -> ClockMatch | None:
    """Find the offset, and the drift of a long piece, from onsets of strokes.

    Args:
        device_s: (N,) increasing, s, of one clock that does not restart.
        track_s: (M,) increasing, s.
        near_s: the offset from absolute times; among equally likely ones the nearest is taken, if it is within half
            a stroke.

    Returns:
        The best relation, or None with fewer than `FEWEST_PAIRS` common strokes.
    """
    fewest = max(FEWEST_PAIRS, math.ceil(FEWEST_SHARE * min(len(device_s), len(track_s))))
    if min(len(device_s), len(track_s)) < fewest:
        return None
    period_s = float(np.median(np.diff(track_s)))
    resolution_s = resolution(device_s)
    tried = [
        _refined(device_s, track_s, start, period_s, resolution_s)
        for start in _starts(device_s, track_s, resolution_s)
    ]
    found = sorted(
        (one for one in tried if one is not None and len(one.match.pairs) >= fewest),
        key=lambda one: -one.support,
    )
    apart = _distinct(found, period_s)
    if not apart:
        return None
    best, *others = apart
    equal = [one for one in others if _is_rival(one, best)]
    chosen = _nearest([best, *equal], near_s, period_s) if equal and near_s is not None else None
    if chosen is not None:
        return chosen.match
    rivals = tuple(sorted((one.match.offset_s for one in equal), key=lambda s: abs(s - best.match.offset_s)))
    return ClockMatch(**{**best.match.__dict__, "rivals_s": rivals})


def resolution(time_s: Floats) -> float:
    """The step in which stamps are written, s; 0 if it is below 10 ms."""
    for step in _RESOLUTIONS_S:
        if np.allclose(time_s / step, np.round(time_s / step), rtol=0.0, atol=1e-3):
            return step
    return 0.0


def _starts(device_s: Floats, track_s: Floats, resolution_s: float) -> list[tuple[float, float]]:
    """Offsets and drifts at which many onsets coincide, the most first."""
    middle_s = _middle(device_s)
    span_s = float(device_s[-1] - device_s[0])
    width_s = max(_BIN_S, resolution_s)
    steps = math.ceil(MOST_DRIFT * span_s / (2.0 * width_s)) if span_s > DRIFT_SPAN_S else 0
    starts = []
    for drift in np.linspace(-MOST_DRIFT, MOST_DRIFT, 2 * steps + 1) if steps else (0.0,):
        apart_s = (track_s[None, :] - (device_s + drift * (device_s - middle_s))[:, None]).ravel()
        low_s = float(apart_s.min())
        counts = np.bincount(((apart_s - low_s) / width_s).astype(np.int64) + 1, minlength=3)
        near = counts + np.append(counts[1:], 0) + np.append(0, counts[:-1])
        starts += [
            (int(near[k]), low_s + (k - 0.5) * width_s, float(drift))
            for k in np.argsort(-near, kind="stable")[:_CANDIDATES]
        ]
    starts.sort(key=lambda one: (-one[0], abs(one[2])))
    kept: list[tuple[float, float]] = []
    for _, offset_s, drift in starts:
        if all(abs(offset_s - other_s) > 3.0 * width_s for other_s, _ in kept):
            kept.append((offset_s, drift))
    return kept[:_CANDIDATES]


def _refined(
    device_s: Floats, track_s: Floats, start: tuple[float, float], period_s: float, resolution_s: float
) -> _Candidate | None:
    """Pair onsets and fit the relation in turn, until the pairs stay the same."""
    middle_s = _middle(device_s)
    offset_s, drift = start
    least_s = max(_LEAST_STD_S, resolution_s / math.sqrt(12.0))
    near_s = max(0.15, 1.5 * resolution_s)
    pairs = np.zeros((0, 2), dtype=np.int64)
    for _ in range(_ROUNDS):
        moved_s = device_s + offset_s + drift * (device_s - middle_s)
        found = _paired(moved_s, track_s, min(near_s, period_s / 3.0))
        if len(found) < FEWEST_PAIRS:
            return None
        same, pairs = np.array_equal(found, pairs), found
        offset_s, drift, scales = _fitted(device_s, track_s, pairs, middle_s, least_s)
        near_s = max(4.0 * scales[0], 3.0 * least_s, 0.04)
        if same:
            break
    std_s, offset_std_s, drift_std = scales
    match = ClockMatch(
        offset_s,
        drift,
        middle_s,
        math.hypot(offset_std_s, resolution_s / math.sqrt(12.0)),
        drift_std,
        std_s,
        pairs,
    )
    unmatched = _unmatched(match, device_s, track_s)
    gain = math.log(period_s / (std_s * math.sqrt(2.0 * math.pi * math.e)))
    return _Candidate(match, len(pairs) * gain - _MISSING * unmatched, unmatched)


def _paired(moved_s: Floats, track_s: Floats, near_s: float) -> Ints:
    """(K, 2) places of onsets that are each other's nearest and at most `near_s` apart."""
    nearest = _nearest_places(moved_s, track_s)
    back = _nearest_places(track_s, moved_s)
    own = np.arange(len(moved_s))
    kept = (back[nearest] == own) & (np.abs(track_s[nearest] - moved_s) <= near_s)
    return np.column_stack([own[kept], nearest[kept]])


def _nearest_places(of_s: Floats, in_s: Floats) -> Ints:
    after = np.clip(np.searchsorted(in_s, of_s), 1, len(in_s) - 1)
    return np.asarray(after - (of_s - in_s[after - 1] < in_s[after] - of_s), dtype=np.int64)


def _fitted(
    device_s: Floats, track_s: Floats, pairs: Ints, middle_s: float, least_s: float
) -> tuple[float, float, tuple[float, float, float]]:
    """Offset and drift; standard deviations of a residual, of the offset and of the drift."""
    own_s = device_s[pairs[:, 0]]
    apart_s = track_s[pairs[:, 1]] - own_s
    rest_s = apart_s - np.median(apart_s)
    std_s = max(float(np.std(rest_s)), least_s)
    is_long = np.ptp(own_s) > DRIFT_SPAN_S
    centred = own_s - middle_s
    prior = (std_s / DRIFT_STD) ** 2
    design = np.column_stack([np.ones(len(own_s)), centred if is_long else np.zeros(len(own_s))])
    normal = design.T @ design + np.diag([0.0, prior])
    offset_s, drift = np.linalg.solve(normal, design.T @ apart_s)
    rest_s = apart_s - offset_s - drift * centred
    std_s = max(float(np.sqrt(np.mean(rest_s**2))), least_s)
    normal = design.T @ design + np.diag([0.0, (std_s / DRIFT_STD) ** 2])
    inverse = np.linalg.inv(normal) * std_s**2 * _related(rest_s)
    scales = (std_s, float(np.sqrt(inverse[0, 0])), float(np.sqrt(inverse[1, 1])) if is_long else 0.0)
    return float(offset_s), float(drift), scales


def _related(rest_s: Floats) -> float:
    """How many times larger the variance of a mean is, because neighbouring residuals are related."""
    power = float(rest_s @ rest_s)
    ahead = float(rest_s[1:] @ rest_s[:-1]) / power if power else 0.0
    ahead = min(max(ahead, 0.0), 0.9)
    return (1.0 + ahead) / (1.0 - ahead)


def _unmatched(match: ClockMatch, device_s: Floats, track_s: Floats) -> int:
    """Onsets of either sequence, within both, without a partner."""
    moved_s = match.on_track(device_s)
    low_s, high_s = max(moved_s[0], track_s[0]) - 0.5, min(moved_s[-1], track_s[-1]) + 0.5
    common = [int(((s >= low_s) & (s <= high_s)).sum()) for s in (moved_s, track_s)]
    return max(sum(common) - 2 * len(match.pairs), 0)


def _distinct(found: list[_Candidate], period_s: float) -> list[_Candidate]:
    """The best of those that pair the same strokes."""
    kept: list[_Candidate] = []
    for one in found:
        if all(abs(one.match.offset_s - other.match.offset_s) > period_s / 4.0 for other in kept):
            kept.append(one)
    return kept


def _is_rival(one: _Candidate, best: _Candidate) -> bool:
    pairs = min(len(one.match.pairs), len(best.match.pairs))
    return best.closeness(pairs) - one.closeness(pairs) < SURE


def _nearest(found: list[_Candidate], near_s: float, period_s: float) -> _Candidate | None:
    best = min(found, key=lambda one: abs(one.match.offset_s - near_s))
    return best if abs(best.match.offset_s - near_s) <= period_s / 2.0 else None


def _middle(time_s: Floats) -> float:
    return float(time_s[0] + time_s[-1]) / 2.0
