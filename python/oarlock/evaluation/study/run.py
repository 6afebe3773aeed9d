"""Simulates, tracks and scores the runs of a study. Scenarios share simulations; a failing run becomes a row."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from oarlock._core import Model
from oarlock.evaluation.evaluate import evaluate
from oarlock.evaluation.scores import Evaluation, JointScore, PositionScore, presentation
from oarlock.evaluation.study.degrade import degraded
from oarlock.evaluation.study.faults.catalogue import afflicted
from oarlock.evaluation.study.faults.fault import Names
from oarlock.evaluation.study.filter_inputs import filter_calibration, filter_config, filter_model
from oarlock.evaluation.study.keys import Value, with_turns
from oarlock.evaluation.study.spec import Study, StudyScenario, stable_text
from oarlock.evaluation.study.trial import StudyTrial
from oarlock.tracking import tracking
from oarlock.tracking.track import Track

Row = dict[str, Any]

SCORES = ("rmse", "bias", "correlation", "coverage_95", "nees", "mean_std", "nis")
MEAN = "mean of angles"
MOST_TOGETHER = 40
"""Largest number of scenarios in a group. Each group simulates its trial once."""


@dataclass(frozen=True)
class Group:
    """Scenarios that track the same trial."""

    key: str
    seed: int
    scenarios: tuple[StudyScenario, ...]
    part: int = 0


def groups(study: Study) -> list[Group]:
    """All runs, grouped by trial, in the order of their first occurrence."""
    found: dict[tuple[str, int], list[StudyScenario]] = {}
    for scenario in study.expanded():
        for seed in study.seeds:
            found.setdefault((stable_text(_simulated(study, scenario.values)), seed), []).append(scenario)
    return [
        Group(key, seed, tuple(scenarios[first : first + MOST_TOGETHER]), first // MOST_TOGETHER)
        for (key, seed), scenarios in found.items()
        for first in range(0, len(scenarios), MOST_TOGETHER)
    ]


def _simulated(study: Study, values: Mapping[str, Value]) -> dict[str, Value]:
    """The values that determine the trial, without those that only the filter uses."""
    own = study.simulator.keys(study.model)
    return {name: v for name, v in values.items() if name in own or name.startswith("parameters.")}


def run_group(study: Study, group: Group, progress: Callable[[], object] | None = None) -> list[Row]:
    """Rows of all runs of a group, in order; `progress` is called after each run."""
    rows: list[Row] = []
    try:
        made: _Trial | Exception = _Trial.make(study, group)
    except Exception as error:
        made = error
    for scenario in group.scenarios:
        rows += _rows(study, scenario, group.seed, made)
        if progress is not None:
            progress()
    return rows


@dataclass
class _Trial:
    """A trial with its true model, and its tracks so far."""

    model: Model
    trial: StudyTrial
    tracks: dict[str, Track] = field(default_factory=dict)

    @classmethod
    def make(cls, study: Study, group: Group) -> _Trial:
        values = group.scenarios[0].values
        lengths = {
            name.removeprefix("parameters."): float(str(value))
            for name, value in values.items()
            if name.startswith("parameters.")
        }
        own = study.model
        model = own.with_parameters(lengths)
        return cls(model, study.simulator.trial(model, _with_defaults(study, values), group.seed))


def _with_defaults(study: Study, values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: key.default for name, key in study.keys.items()} | dict(values)


def _rows(study: Study, scenario: StudyScenario, seed: int, made: _Trial | Exception) -> list[Row]:
    start: Row = {
        "scenario": scenario.index,
        "name": scenario.name,
        "seed": seed,
        "swept": dict(scenario.swept),
    }
    try:
        if isinstance(made, Exception):
            raise made
        track = _tracked(study, scenario, seed, made)
        scores = evaluate(track, made.trial.truth, start_s=study.start_s, frames=study.frames)
    except Exception as error:
        failed = {"kind": "run", "item": "", "unit": "", **dict.fromkeys(SCORES, math.nan)}
        return [{**start, **failed, "error": f"{type(error).__name__}: {error}"}]
    return [{**start, "error": "", **row} for row in _score_rows(study, scores)]


def _tracked(study: Study, scenario: StudyScenario, seed: int, made: _Trial) -> Track:
    """The scored track. If a scenario differs only by smoothing, the filter is not run again."""
    values = _with_defaults(study, scenario.values)
    smooth = values.pop("smooth")
    key = stable_text(values)
    if key not in made.tracks:
        made.tracks.clear()
        made.tracks[key] = _filtered(study, values, seed, made)
    track = made.tracks[key]
    return tracking.smooth(track) if smooth else track


def _filtered(study: Study, values: Mapping[str, Value], seed: int, made: _Trial) -> Track:
    model, lengths = made.model, study.simulator.lengths(made.model)
    values = with_turns(values, Names.of(model).units, seed)
    recording = degraded(afflicted(made.trial, model, values, seed), values, seed)
    return tracking.track(
        filter_model(model, values, seed),
        recording,
        calibration=filter_calibration(model, lengths, values, seed),
        config=filter_config(made.trial, values, seed),
    )


def _score_rows(study: Study, scores: Evaluation) -> list[Row]:
    rows = [_joint_row(joint) for joint in scores.joints if joint.observed]
    for place in scores.positions:
        rows += _position_rows(place)
    rows += [_row("sensor", sensor.name, "", nis=sensor.nis) for sensor in scores.sensors]
    return [*rows, _mean_row(study, scores)]


def _row(kind: str, item: str, unit: str, **scores: float) -> Row:
    return {"kind": kind, "item": item, "unit": unit, **dict.fromkeys(SCORES, math.nan), **scores}


def _joint_row(joint: JointScore) -> Row:
    shown = joint.row
    return _row(
        "joint",
        joint.name,
        shown["unit"],
        rmse=shown["rmse"],
        bias=shown["bias"],
        correlation=joint.correlation,
        coverage_95=joint.coverage,
        nees=joint.nees,
        mean_std=shown["mean_std"],
    )


def _position_rows(place: PositionScore) -> list[Row]:
    factor, unit = presentation("m")
    errors = zip("xyz", place.axis_rmse_m, place.axis_correlation, strict=True)
    parts = [
        _row("frame", f"{place.frame}.{axis}", unit, rmse=rmse * factor, correlation=r)
        for axis, rmse, r in errors
    ]
    whole = _row("frame", place.frame, unit, rmse=place.rmse_m * factor, coverage_95=place.coverage)
    return [whole, *parts]


def _mean_row(study: Study, scores: Evaluation) -> Row:
    names = study.joints or None
    turning = scores.turning(names)
    if gone := [joint.name for joint in turning if not joint.observed]:
        missing = f"no mean: the remaining sensors do not observe {', '.join(gone)}"
        return _row("mean", MEAN, "deg") | {"error": missing}
    r = [joint.correlation for joint in turning if math.isfinite(joint.correlation)]
    return _row(
        "mean",
        MEAN,
        "deg",
        rmse=scores.mean_rmse_deg(names),
        correlation=sum(r) / len(r) if r else math.nan,
        coverage_95=scores.mean_coverage(names),
        nees=scores.states.nees if scores.states else math.nan,
    )
