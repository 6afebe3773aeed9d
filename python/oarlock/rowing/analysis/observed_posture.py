"""Postures of a track without what no sensor determines, for technique and the report's drawings."""

from __future__ import annotations

import numpy as np

from oarlock import Track
from oarlock.rowing.analysis.rower_places import SIDES, RowerFrames
from oarlock.storage.arrays import Floats

SEEN_SHARE = 0.5
"""What is observed in less than this share of the time counts as not observed."""


def observed_q(track: Track, rower: RowerFrames) -> Floats:
    """Coordinates (T, n_coordinates); NaN in rows where a handle's joint is not observed, and where an arm never is.

    An oar that neither its encoder nor the arm measures stands at its rest, and an arm without sensors follows its
    prior. Positions from these would look like measured ones.
    """
    names = list(track.coordinate_names)
    unseen = np.zeros(track.q.shape, dtype=bool)
    handles = [names.index(name) for name in rower.handle_joints]
    unseen[:, handles] = ~track.observed[:, handles]
    for side in SIDES:
        arm = [names.index(name) for name in rower.arm_joints(side)]
        if arm and track.observed[:, arm].all(axis=1).mean() < SEEN_SHARE:
            unseen[:, arm] = True
    return np.where(unseen, np.nan, track.q)
