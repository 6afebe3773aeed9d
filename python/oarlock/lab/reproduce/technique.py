"""The two features of section 5 of the paper: back lean, and the plane of upper arm and forearm at the finish."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import oarlock
from oarlock import Model, Recording, Track, load_model
from oarlock.lab.reproduce.contents import Floats
from oarlock.rowing.analysis.stroke_values import BENT_RAD, arm_normal
from oarlock.rowing.field.trial import simulate_field
from oarlock.rowing.simulation.experiment import simulate_sculling

NEAR_FINISH = 0.9
"""Share of the oar's sweep after which the oar counts as near the finish."""


@dataclass(frozen=True)
class Features:
    """RMS errors of trunk lean and of the arm plane's normal near the finish, deg; steps per s of processor time."""

    lean_deg: float
    plane_deg: float
    steps_per_s: float


def features(seed: int, duration_s: float) -> dict[str, Features]:
    """Errors in a recording as modelled, and in a field recording."""
    model = load_model("sculler")
    truth, recording = simulate_sculling(model, "B-B", duration_s, (20.0, 34.0), seed)
    trial = simulate_field(model, condition="B-B", duration_s=duration_s, seed=seed)
    pairs = {"as modelled": (truth, recording), "field": (trial.truth, trial.recording)}
    return {name: _features(model, own, true) for name, (true, own) in pairs.items()}


def _features(model: Model, recording: Recording, truth: Track) -> Features:
    began = time.process_time()
    track = oarlock.track(model, recording)
    spent_s = time.process_time() - began
    scores = oarlock.evaluate(track, truth, frames=())
    errors = [_plane_errors(track, truth, side) for side in ("r", "l")]
    return Features(
        float(np.degrees(scores["trunk"].rmse)),
        float(np.sqrt(np.mean(np.concatenate(errors) ** 2))),
        float(track.provenance["steps"]) / spent_s,
    )


def _plane_errors(track: Track, truth: Track, side: str) -> Floats:
    """Angles between the estimated and the true normal, deg, near the finish."""
    phi = np.interp(track.time_s, truth.time_s, truth.hinge(f"{side}_oar_phi").angle_rad)
    sweep = (phi - phi.min()) / np.ptp(phi)
    elbow = np.interp(track.time_s, truth.time_s, truth.hinge(f"{side}_elbow_flexion").angle_rad)
    kept = (sweep > NEAR_FINISH) & (elbow > BENT_RAD) & (track.time_s > track.time_s[0] + 2.0)
    own = _normal(track, side)[kept]
    true = np.stack(
        [np.interp(track.time_s[kept], truth.time_s, column) for column in _normal(truth, side).T], 1
    )
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    across, along = np.linalg.norm(np.cross(own, true), axis=1), np.sum(own * true, axis=1)
    return np.asarray(np.degrees(np.arctan2(across, along)))


def _normal(track: Track, side: str) -> Floats:
    shoulder, elbow, wrist = (
        track.frame_positions(f"{side}_{name}") for name in ("shoulder", "elbow", "wrist")
    )
    return arm_normal(shoulder, elbow, wrist)
