"""A simulated truth as a track that a filter might have made."""

from dataclasses import replace

import numpy as np

import oarlock
from oarlock.rowing.simulation.experiment import simulate_sculling


def rowed(condition: str, duration_s: float, rate: float | tuple[float, float], seed: int) -> oarlock.Track:
    """With deviations as a filter would claim them: half a degree."""
    model = oarlock.load_model("sculler")
    truth = simulate_sculling(model, condition, duration_s, rate_spm=rate, seed=seed)[0]
    return replace(truth, q_std=np.full(truth.q.shape, 0.005), qd_std=np.full(truth.q.shape, 0.02))
