"""Errors of a tracked sculler as the pages show them: eleven angles, hands, and positions, each with its bands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import oarlock
from oarlock.evaluation.errors import position_score
from oarlock.evaluation.resample import resample
from oarlock.storage.arrays import Floats

SHOULDER = ("shoulder_abduction", "shoulder_rotation", "shoulder_flexion")
ARM = (*SHOULDER, "elbow_flexion", "elbow_rotation")
ELEVEN = ("trunk", *(f"{side}_{joint}" for side in "rl" for joint in ARM))
"""Angles of trunk and arms."""
RADIAL = ("r_hand_abduction", "l_hand_abduction")
PALMAR = ("r_hand_flexion", "l_hand_flexion")
HANDS = RADIAL + PALMAR
PLACES = tuple(f"{side}_{place}" for place in ("shoulder", "elbow", "wrist") for side in "rl")
SETTLED_S = 2.0
"""The first seconds are not scored."""


@dataclass(frozen=True)
class Errors:
    """Mean RMSE over angles or positions, and mean share inside the 95 % bands; `worst_deg` of the eleven angles."""

    mean_deg: float
    worst_deg: float
    coverage: float
    hands_deg: float
    hands_coverage: float
    places_mm: float
    places_coverage: float


def errors(
    track: oarlock.Track, truth: oarlock.Track, true_s: Floats, true_m: Mapping[str, Floats]
) -> Errors:
    """Score a track against joint values and against positions (T, 3) at the times (T,)."""
    scores = angles(track, truth)
    rows = track.time_s >= track.time_s[0] + SETTLED_S
    places = []
    for frame in PLACES:
        at_s = track.time_s[rows]
        true = np.stack([resample(true_s, axis, at_s) for axis in true_m[frame].T], axis=1)
        std = track.frame_position_stds(frame)[rows]
        places.append(position_score(frame, track.frame_positions(frame)[rows], true, std))
    return Errors(
        mean_deg=scores.mean_rmse_deg(ELEVEN),
        worst_deg=scores.worst_rmse_deg(ELEVEN),
        coverage=scores.mean_coverage(ELEVEN),
        hands_deg=scores.mean_rmse_deg(HANDS),
        hands_coverage=scores.mean_coverage(HANDS),
        places_mm=1e3 * float(np.mean([place.rmse_m for place in places])),
        places_coverage=float(np.mean([place.coverage for place in places])),
    )


def angles(track: oarlock.Track, truth: oarlock.Track) -> oarlock.evaluation.Evaluation:
    """Scores of the joints, without the first seconds."""
    return oarlock.evaluate(track, truth, start_s=SETTLED_S)
