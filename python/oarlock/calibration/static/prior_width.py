"""`prior_share`: how wide a prior the motion supports, for `calibrate_hinge_axes` and `calibrate_joint_centers`.

The width is estimated from the same motion (empirical Bayes, type II maximum likelihood; Morris 1983). If what is seen
differs from the nominal values by no more than its own uncertainty, these are known better than stated, and a change
would only add that uncertainty.
"""

from __future__ import annotations

import numpy as np

from oarlock.storage.arrays import Floats

SHARES = np.geomspace(0.01, 1.0, 101)
"""Widths that are tried, as shares of the stated standard deviations."""


def prior_share(motion: Floats, std: Floats, change: Floats) -> float:
    """Share of the stated standard deviations with the largest likelihood of what the motion shows, at most 1.

    Args:
        motion: (n, n) information of the motion alone.
        std: (n,) stated standard deviations of the nominal values.
        change: (n,) most likely change of the nominal values with these.

    Returns:
        0 if no change is more likely than any: the values stay nominal.
    """
    strengths, directions = np.linalg.eigh(std[:, None] * motion * std)
    strengths = np.maximum(strengths, 0.0)
    # The motion's information vector: at the most likely change it and the prior balance.
    pulled = (1.0 + strengths) * (directions.T @ (change / std))

    def likelihood(share: float) -> float:
        gain = share**2 / (1.0 + share**2 * strengths)
        return float((gain * pulled**2 - np.log1p(share**2 * strengths)).sum())

    best = max(SHARES, key=likelihood)
    return float(best) if likelihood(best) > 0.0 else 0.0
