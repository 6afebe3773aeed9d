"""Simulated and tracked field recordings, compared with their markers, for Table 6 and Figures 4 and 5."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import oarlock
from oarlock import Config, Model, Recording, Track, load_model
from oarlock.evaluation.child_process import in_processes
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.lab.reproduce.contents import Floats
from oarlock.lab.reproduce.places import PlaceBand, place_band
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.trial import simulate_field
from oarlock.rowing.simulation import paper
from oarlock.storage.progress import Told

START_S = 2.0
RATE_HZ = 100.0
BELIEFS_S = 0.1
POINTS = tuple(paper.table_6())
NOT_PUBLIC = (
    "The paper's recordings are not public. These are simulated: oarlock.rowing.simulate_field models skin motion, "
    "gliding shoulders, a bending spine, a slipping grip, rotation of the boat, and errors of mounts, lengths, "
    "encoders, iron, drift, dropouts and clocks. Other errors of real recordings are not included: compare "
    "the pattern, not the digits."
)
_PAPER_CONFIG = {"structure": "tree", "estimate": (), "gate": False, "magnetometer": "on"}

_Given = tuple[Model, Mapping[str, FieldEffects], float]
_Trial = tuple[Recording, Markers]


@dataclass(frozen=True)
class Setting:
    """A setting of the field and the filter."""

    key: str
    label: str
    condition: str
    effects: FieldEffects
    config: dict[str, Any]
    smooth: bool = False


def _indoor() -> FieldEffects:
    """Effects on an ergometer at rest: all except the boat's rotation."""
    hull = dict.fromkeys(("hull_pitch_rad", "hull_roll_rad", "hull_yaw_rad", "hull_heave_m"), 0.0)
    return FieldEffects(**hull)


SETTINGS = (
    Setting(
        "paper_indoor",
        "indoors, as the paper: fixed noise, no slow states",
        "S-B",
        _indoor(),
        dict(_PAPER_CONFIG),
    ),
    Setting("indoor", "indoors, as shipped", "S-B", _indoor(), {}),
    Setting("indoor_smoothed", "indoors, as shipped, smoothed", "S-B", _indoor(), {}, smooth=True),
    Setting("water", "on the water, as shipped", "B-B", FieldEffects(), {}),
    Setting(
        "water_open",
        "on the water, without closure",
        "B-B",
        FieldEffects(),
        {"closures": False},
    ),
)


@dataclass(frozen=True)
class TrackedTrial:
    """A tracked trial. `points` has for each name RMSE (3,) m, 3D RMSE m, correlation (3,), NEES, coverage."""

    setting: Setting
    seed: int
    markers: Markers
    track: Track
    bands: dict[str, PlaceBand]
    points: dict[str, dict[str, float]]


def field_trials(
    seeds: Sequence[int],
    duration_s: float,
    jobs: int | None,
    progress: Told | None,
    keys: Sequence[str] = (),
) -> list[TrackedTrial]:
    """All settings for all seeds; lost tracks are left out."""
    settings = [s for s in SETTINGS if not keys or s.key in keys]
    model = load_model("sculler")
    effects = {setting.condition: setting.effects for setting in settings}
    tasks = [(condition, seed) for condition in effects for seed in seeds]
    trials: dict[tuple[str, int], _Trial] = {}
    for key, trial in in_processes(_trial, (model, effects, duration_s), tasks, jobs or os.cpu_count() or 1):
        trials[key] = trial
        if progress is not None:
            progress(0.5 * len(trials) / len(tasks))
    pairs = [(setting, seed) for setting in settings for seed in seeds]
    found: list[TrackedTrial] = []
    for smooth in (False, True):
        own = [(setting, seed) for setting, seed in pairs if setting.smooth == smooth]
        tracks = oarlock.track_many(
            model,
            [trials[setting.condition, seed][0] for setting, seed in own],
            config=[_config(setting) for setting, seed in own],
            smooth=smooth,
            threads=jobs,
            on_error="return",
        )
        for (setting, seed), track in zip(own, tracks, strict=True):
            if isinstance(track, Track):
                found.append(_scored(setting, seed, trials[setting.condition, seed][1], track))
    found.sort(key=lambda scored: [s.key for s in settings].index(scored.setting.key))
    return found


def _trial(given: _Given, task: tuple[str, int]) -> _Trial:
    (model, effects, duration_s), (condition, seed) = given, task
    whole = simulate_field(
        model, effects[condition], condition=condition, duration_s=duration_s, rate_hz=RATE_HZ, seed=seed
    )
    return whole.recording, whole.markers


def _config(setting: Setting) -> Config:
    return Config(belief_interval_s=BELIEFS_S, **setting.config)


def _scored(setting: Setting, seed: int, markers: Markers, track: Track) -> TrackedTrial:
    scores = oarlock.markers.evaluate_markers(
        track, markers, align_clock=False, align_frame=False, start_s=START_S
    )
    bands = {name: place_band(track, name, START_S) for name in POINTS}
    points = {}
    for name in POINTS:
        score, band = scores.points[name], bands[name]
        truth = marker_at(markers, name, band.time_s)
        points[name] = {
            "rmse_3d_m": float(score.rmse_3d_m),
            **{f"rmse_{axis}_m": float(v) for axis, v in zip("xyz", score.rmse_m, strict=True)},
            **{f"r_{axis}": float(v) for axis, v in zip("xyz", score.correlation, strict=True)},
            "r": mean_r(score.correlation),
            "nees": band.nees(truth),
            "coverage_95": band.coverage(truth),
        }
    return TrackedTrial(setting, seed, markers, track, bands, points)


def marker_at(markers: Markers, name: str, time_s: Floats) -> Floats:
    """Position of a marker (T, 3), m, root axes; NaN outside the recording."""
    k = markers.names.index(name)
    columns = [
        np.interp(time_s, markers.time_s, markers.position_m[:, k, axis], np.nan, np.nan) for axis in range(3)
    ]
    return np.stack(columns, axis=1)


def mean_r(correlation: Floats) -> float:
    """Mean over the axes: the paper gives a single figure without a definition."""
    kept = np.asarray(correlation)[np.isfinite(correlation)]
    return float(kept.mean()) if len(kept) else math.nan
