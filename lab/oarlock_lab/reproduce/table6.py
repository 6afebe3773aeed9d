"""Table 6: errors of shoulder, elbow and wrist positions relative to markers, on simulated field recordings."""

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
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.trial import simulate_field
from oarlock.rowing.simulation import paper
from oarlock.storage.arrays import Floats
from oarlock.storage.progress import Told
from oarlock.storage.statistics import NORMAL_95
from oarlock_lab.reproduce.contents import Cell, PaperPart, Row, Table, finite_mean, rounded, spread

NO_BAND_M = 1e-9


@dataclass(frozen=True)
class PlaceBand:
    """A frame's position at the track's beliefs: mean (K, 3) and covariance (K, 3, 3), m, in root axes."""

    time_s: Floats
    position_m: Floats
    covariance_m2: Floats

    def half_band(self, time_s: Floats) -> Floats:
        """Half of the 95 % band (T, 3), m, linear between beliefs."""
        std = np.sqrt(np.einsum("kii->ki", self.covariance_m2))
        return np.stack(
            [NORMAL_95 * np.interp(time_s, self.time_s, std[:, axis]) for axis in range(3)], axis=1
        )

    def nees(self, truth_m: Floats) -> float:
        """Mean of (error / std)^2 over beliefs and axes (Bar-Shalom et al. 2001, section 5.4); truth (K, 3).

        Axes along which the frame cannot move in the model (a shoulder sideways) have no band and are left out.
        """
        return float(np.nanmean(self._ratio(truth_m) ** 2))

    def coverage(self, truth_m: Floats) -> float:
        """Share of beliefs and axes inside the 95 % band, of those that have one; truth (K, 3)."""
        ratio = self._ratio(truth_m)
        return float(np.mean(np.abs(ratio[np.isfinite(ratio)]) <= NORMAL_95))

    def _ratio(self, truth_m: Floats) -> Floats:
        std = np.sqrt(np.einsum("kii->ki", self.covariance_m2))
        error = self.position_m - truth_m
        return np.asarray(np.divide(error, std, out=np.full_like(std, np.nan), where=std > NO_BAND_M))


def place_band(track: Track, frame: str, start_s: float) -> PlaceBand:
    """Position and covariance to first order around each belief.

    Input coordinates and lengths that are not states count as exact.
    """
    beliefs, model = track.beliefs, track.model
    if beliefs is None or model is None:
        raise ValueError("a track without beliefs has no bands")
    names = [name for name in track.coordinate_names if name in beliefs.state_names]
    columns = [track.coordinate_names.index(name) for name in names]
    states = [beliefs.state_names.index(name) for name in names]
    rows = beliefs.time_s >= track.time_s[0] + start_s
    q = np.zeros((int(rows.sum()), len(track.coordinate_names)))
    q[:, columns] = beliefs.mean[rows][:, states]
    place = model.forward_kinematics(q)[:, model.frame_names.index(frame), :3, 3]
    slopes = model.frame_jacobian(q, [frame]).by_coordinate[:, 0, :3][..., columns]
    covariance = beliefs.covariance[rows][:, states][:, :, states]
    return PlaceBand(
        np.asarray(beliefs.time_s[rows]), place, np.einsum("kia,kab,kjb->kij", slopes, covariance, slopes)
    )


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

_TrialInput = tuple[Model, Mapping[str, FieldEffects], float]
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
    tracked: list[TrackedTrial] = []
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
                tracked.append(_scored(setting, seed, trials[setting.condition, seed][1], track))
    tracked.sort(key=lambda scored: [s.key for s in settings].index(scored.setting.key))
    return tracked


def _trial(inputs: _TrialInput, task: tuple[str, int]) -> _Trial:
    (model, effects, duration_s), (condition, seed) = inputs, task
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
    finite = np.asarray(correlation)[np.isfinite(correlation)]
    return float(finite.mean()) if len(finite) else math.nan


TARGET_MM = 30.0


def table6(scored: Sequence[TrackedTrial], duration_s: float) -> PaperPart:
    """The paper's table with our values, then errors per axis, with bands and NEES."""
    settings = [s for s in SETTINGS if any(trial_scores.setting.key == s.key for trial_scores in scored)]
    seeds = sorted({trial_scores.seed for trial_scores in scored})
    return PaperPart(
        key="table6",
        title="Table 6: positions against optical markers",
        lead=(
            NOT_PUBLIC,
            f"{len(seeds)} simulated {'trial' if len(seeds) == 1 else 'trials'} of {duration_s:g} s at {RATE_HZ:g} Hz, "
            "20 to 34 strokes per minute, scored from 2 s on in root axes, without fitting clock or axes to the "
            "markers. Markers are at the true joint centres. The filter has nominal lengths and mounts: nothing was "
            "calibrated.",
        ),
        tables=(_main(scored, settings), *(_axes(scored, setting) for setting in settings)),
        notes=(
            paper.SLIPS["rates"],
            paper.SLIPS["axes"],
            "The paper gives one correlation for each position without a definition; ours is the mean over the axes.",
            "Target: a mean 3D error of at most 30 mm on the water, as shipped.",
        ),
        data={"table6": rows(scored)},
    )


def rows(scored: Sequence[TrackedTrial]) -> list[Row]:
    """One row for each setting, seed and point, with the printed value."""
    printed = paper.table_6()
    return [
        {
            "setting": trial.setting.key,
            "condition": trial.setting.condition,
            "seed": trial.seed,
            "point": name,
            **trial.points[name],
            "paper_rmse_m": printed[name].rmse_m,
            "paper_r": printed[name].correlation,
        }
        for trial in scored
        for name in POINTS
    ]


def values(scored: Sequence[TrackedTrial], setting: str, point: str, score: str) -> list[float]:
    """One score over the seeds."""
    return [
        trial_scores.points[point][score] for trial_scores in scored if trial_scores.setting.key == setting
    ]


def _main(scored: Sequence[TrackedTrial], settings: Sequence[Setting]) -> Table:
    printed = paper.table_6()
    table_rows = []
    for point in POINTS:
        cells = [Cell(point)]
        for setting in settings:
            errors = [1e3 * v for v in values(scored, setting.key, point, "rmse_3d_m")]
            r = finite_mean(values(scored, setting.key, point, "r"))
            cells.append(
                Cell(
                    f"{rounded(finite_mean(errors))}, r {r:.3f}",
                    paper=f"{1e3 * printed[point].rmse_m:.0f}, r {printed[point].correlation:.3f}",
                    spread=spread(errors),
                )
            )
        table_rows.append(tuple(cells))
    table_rows.append((Cell("mean"), *(_mean_cell(scored, setting) for setting in settings)))
    return Table(
        "table6-main",
        "3D RMSE in mm, with its spread over the trials, and correlation; the paper's value below.",
        ("position", *(s.label for s in settings)),
        tuple(table_rows),
    )


def _mean_cell(scored: Sequence[TrackedTrial], setting: Setting) -> Cell:
    errors = np.array([values(scored, setting.key, point, "rmse_3d_m") for point in POINTS]) * 1e3
    mean = finite_mean(errors)
    whole = finite_mean([1e3 * p.rmse_m for p in paper.table_6().values()])
    if setting.key != "water":
        return Cell(rounded(mean), paper=f"{whole:.0f}", spread=spread(errors.mean(axis=0)))
    return Cell(
        rounded(mean),
        paper=f"{whole:.0f}",
        spread=spread(errors.mean(axis=0)),
        bound=f"{TARGET_MM:g}",
        mark="met" if mean <= TARGET_MM else "missed",
    )


def _axes(scored: Sequence[TrackedTrial], setting: Setting) -> Table:
    table_rows = []
    for point in POINTS:
        of = {k: values(scored, setting.key, point, k) for k in next(iter(scored)).points[point]}
        errors = [Cell(rounded(1e3 * finite_mean(of[f"rmse_{axis}_m"]))) for axis in "xyz"]
        correlations = [Cell(_r(finite_mean(of[f"r_{axis}"]))) for axis in "xyz"]
        finite = (
            Cell(f"{100 * finite_mean(of['coverage_95']):.0f} %"),
            Cell(rounded(finite_mean(of["nees"]), 2)),
        )
        table_rows.append((Cell(point), *errors, *correlations, *finite))
    return Table(
        f"table6-{setting.key.replace('_', '-')}",
        f"{setting.label[0].upper()}{setting.label[1:]}: RMSE in mm and correlation along each axis (x left, y up, z "
        "to the feet), share of samples inside the 95 % band, NEES per coordinate (1 is consistent).",
        ("position", *(f"RMSE {a}" for a in "xyz"), *(f"r {a}" for a in "xyz"), "in 95 % band", "NEES"),
        tuple(table_rows),
        closed=setting.key not in ("indoor", "water"),
    )


def _r(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "constant"
