"""Which strokes of two seats belong together. For `crew_timing` and the question `crew` of a season."""

from __future__ import annotations

import numpy as np

from oarlock.storage.arrays import Floats, Indices

NEAR_SHARE = 0.25
"""Catches of two seats further apart than this share of a stroke are not of one stroke."""
FURTHEST_S = 0.5
"""As `NEAR_SHARE`, at most; a pause would make a stroke long."""


def matched(leader_s: Floats, own_s: Floats) -> tuple[Indices, Indices]:
    """Places (M,) of the strokes that belong together, in both, in order of time.

    Two catches belong together if each is the nearest of the other and they are less than a quarter of a stroke and
    0.5 s apart. So a stroke that one seat missed, or took alone, has no partner.

    Args:
        leader_s: (N,) increasing times of catches, s.
        own_s: (K,) of another seat, on the same clock.
    """
    if not len(leader_s) or not len(own_s):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    near = _nearest(leader_s, own_s)
    back = _nearest(own_s, leader_s)
    rows = np.arange(len(own_s))
    apart = np.abs(own_s - leader_s[near])
    good = (back[near] == rows) & (apart <= _reach(leader_s)[near])
    return near[good], rows[good]


def delays(leader_s: Floats, own_s: Floats) -> Floats:
    """How much later than the leader's each catch is, (K,) s; NaN without a partner. Arguments as `matched`."""
    late = np.full(len(own_s), np.nan)
    theirs, own = matched(leader_s, own_s)
    late[own] = own_s[own] - leader_s[theirs]
    return late


def aligning_shift(leader_s: Floats, own_s: Floats) -> float:
    """The shift, s, of the other clock with which most strokes match, and of these the most even ones.

    For clocks whose difference is not known. All differences of a catch and a catch of the leader are tried; evenness
    decides which stroke is which, because no two strokes take the same time.
    """
    if not len(leader_s) or not len(own_s):
        return 0.0
    tried = np.unique(np.round((leader_s[:, None] - own_s[None, :]).ravel(), 1))
    step = max(1, len(tried) // _MOST_SHIFTS)
    best, score = 0.0, (-1.0, 0.0)
    for shift in tried[::step]:
        late = delays(leader_s, own_s + shift)
        known = late[np.isfinite(late)]
        if len(known) < _FEWEST:
            continue
        centre = float(np.median(known))
        even = float(np.mean(np.minimum(np.abs(known - centre), 0.1)))
        found = (len(known) * (1.0 - even / 0.1), -abs(shift))
        if found > score:
            best, score = float(shift) - centre, found
    return best


_MOST_SHIFTS = 20_000
_FEWEST = 3


def _nearest(among: Floats, times: Floats) -> Indices:
    """Place of the nearest of `among` for each time."""
    right = np.clip(np.searchsorted(among, times), 1, max(len(among) - 1, 1)) if len(among) > 1 else None
    if right is None:
        return np.zeros(len(times), dtype=np.intp)
    return np.where(times - among[right - 1] <= among[right] - times, right - 1, right)


def _reach(catch_s: Floats) -> Floats:
    """How far from each catch its partner may be, s: by the shorter of the strokes before and after."""
    gaps = np.diff(catch_s)
    before, after = np.append(np.inf, gaps), np.append(gaps, np.inf)
    return np.asarray(np.minimum(NEAR_SHARE * np.minimum(before, after), FURTHEST_S))
