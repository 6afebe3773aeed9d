"""From when the numbers of a track count: not while the filter still converges. For ranges and cycles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.movement.angles import Floats, MovementAngle

USUAL = 0.95
"""Quantile of the standard deviations of the second half that counts as their usual largest value."""
NEAR = 1.25
"""A standard deviation has settled within a quarter of this value."""


def settled_s(time_s: Floats, angles: Sequence[MovementAngle]) -> float:
    """The time by which the standard deviations of all angles have fallen to what is usual in the second half, s.

    The angle that settles last decides. Angles without standard deviations, and those that begin later than the
    track, do not count. At the latest it is the middle of the track.
    """
    found = [_settles_s(time_s, angle) for angle in angles if np.isfinite(angle.std_deg[:1]).all()]
    return max(found, default=float(time_s[0]))


def _settles_s(time_s: Floats, angle: MovementAngle) -> float:
    middle_s = 0.5 * float(time_s[0] + time_s[-1])
    later = angle.std_deg[time_s >= middle_s]
    later = later[np.isfinite(later)]
    if not later.size:
        return float(time_s[0])
    reached = time_s[angle.std_deg <= NEAR * float(np.quantile(later, USUAL))]
    return min(float(reached[0]), middle_s) if reached.size else middle_s
