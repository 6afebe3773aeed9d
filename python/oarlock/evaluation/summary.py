"""Summary of a track in a few numbers: samples, speed, use of each sensor's readings. For terminal and report."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.scores import SensorScore
from oarlock.model.coordinates import joint_columns
from oarlock.storage.epoch import moment_text
from oarlock.tracking.track import Track


@dataclass(frozen=True)
class TrackSummary:
    """Key figures of a track for the top of a page; `steps_per_s` is None for a track without a filter run.

    `start` is the moment of the first sample as text, empty if it is not known.

    A joint is observed if at some time all of its coordinates were.
    """

    model: str
    samples: int
    duration_s: float
    start: str
    rate_hz: float
    steps_per_s: float | None
    smoothed: bool
    joints: int
    joints_observed: int
    not_observed: tuple[str, ...]
    notes: tuple[str, ...]
    sensors: tuple[SensorScore, ...]


def summarize(track: Track) -> TrackSummary:
    """The summary of a track. That of a simulated ground truth contains no sensors."""
    samples = len(track.time_s)
    duration_s = float(track.time_s[-1] - track.time_s[0]) if samples else 0.0
    observed = np.asarray(track.observed, dtype=bool)
    columns = joint_columns(track.coordinate_names)
    seen = [bool(observed[:, list(columns[name])].all(axis=1).any()) for name in track.joint_names]
    steps_per_s = track.provenance.get("steps_per_s")
    whole = Interval(-math.inf, math.inf)
    return TrackSummary(
        model=str(getattr(track.model, "name", track.provenance.get("model", "unknown"))),
        samples=samples,
        duration_s=duration_s,
        start=moment_text(track.provenance.get("epoch"), float(track.time_s[0])) if samples else "",
        rate_hz=(samples - 1) / duration_s if duration_s > 0.0 else math.nan,
        steps_per_s=None if steps_per_s is None else float(steps_per_s),
        smoothed=bool(track.smoothed),
        joints=len(track.joint_names),
        joints_observed=sum(seen),
        not_observed=tuple(name for name, ok in zip(track.joint_names, seen, strict=True) if not ok),
        notes=tuple(track.notes),
        sensors=sensor_scores(track, whole) if track.info is not None else (),
    )
