"""One row of a comparison: errors, standard deviations and processor time of an estimator on a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.evaluation.comparison.estimators import Estimator
from oarlock.evaluation.scores import Evaluation

if TYPE_CHECKING:
    from oarlock._core import Model

SIDES = {"r", "l", "right", "left"}
LANDMARKS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
FINE_COVERAGE = 0.95

LEVEL = 0.02
"""Numbers that differ by less than this share count as equal: another seed may change their order."""


@dataclass(frozen=True)
class Score:
    """Scores of one estimator on one recording; NaN where a score does not exist.

    Args:
        estimator: the estimator.
        mean_rmse_deg: mean RMSE of the chosen rotational joints, deg.
        worst_rmse_deg: the largest RMSE of these, deg.
        correlation: mean over the same joints.
        slides_rmse_m: RMSE of each slide, m.
        positions_rmse_m: RMSE of frames' positions in root axes, m; both sides of a body together.
        nees: per state, of all states of the observed joints; NaN without beliefs.
        coverage: share of errors inside the 95 % bands; NaN without standard deviations.
        step_us: time of the filter alone for one instant, microseconds.
        kinematics_us: time of the inverse kinematics for one instant; NaN where the filter needs none.
        joints: how many of the chosen joints were scored.
        evaluation: the complete evaluation.
        notes: notes of the track.
    """

    estimator: Estimator
    mean_rmse_deg: float
    worst_rmse_deg: float
    correlation: float
    slides_rmse_m: Mapping[str, float]
    positions_rmse_m: Mapping[str, float]
    nees: float
    coverage: float
    step_us: float
    kinematics_us: float
    joints: int
    evaluation: Evaluation = field(repr=False)
    notes: tuple[str, ...] = field(repr=False, default=())

    @property
    def name(self) -> str:
        """The estimator's."""
        return self.estimator.name

    @property
    def steps_per_s(self) -> float:
        """Instants per second of the filter alone."""
        return 1e6 / self.step_us

    def columns(self) -> dict[str, float]:
        """The numbers by column name, as in `compare.csv`."""
        slides = {f"{name}_rmse_mm": 1e3 * value for name, value in self.slides_rmse_m.items()}
        places = {f"{name}_position_mm": 1e3 * value for name, value in self.positions_rmse_m.items()}
        return {
            "mean_rmse_deg": self.mean_rmse_deg,
            "worst_rmse_deg": self.worst_rmse_deg,
            **slides,
            **places,
            "correlation": self.correlation,
            "nees_per_state": self.nees,
            "coverage_95": self.coverage,
            "step_us": self.step_us,
            "kinematics_us": self.kinematics_us,
            "steps_per_s": self.steps_per_s,
        }


def chosen_joints(model: Model) -> tuple[str, ...]:
    """Rotational joints between the root and an inertial unit, which every estimator can determine.

    Named as in `Evaluation`. Without units in the model: all rotational joints that are not inputs.
    """
    described = model.describe()
    frames = {f.name: f for f in described.frames}
    moves_unit: set[str | None] = set()
    for sensor in described.inertial_units:
        at: str | None = sensor.frame
        while at is not None:
            moves_unit.add(frames[at].joint)
            at = frames[at].parent
    turning = [j for j in described.joints if j.kind in ("hinge", "ball", "free") and not j.input]
    names = [j for j in turning if j.name in moves_unit] or turning
    return tuple(f"{j.name}.rotation" if j.kind == "free" else j.name for j in names)


def score(
    estimator: Estimator,
    evaluation: Evaluation,
    joints: tuple[str, ...],
    step_us: float,
    kinematics_us: float,
    notes: tuple[str, ...],
) -> Score:
    """The row of one estimator."""
    scored = tuple(s.name for s in evaluation.joints if s.name in joints and s.observed)
    related = [c for name in scored if math.isfinite(c := evaluation[name].correlation)]
    banded = [name for name in scored if math.isfinite(evaluation[name].coverage)]
    return Score(
        estimator=estimator,
        mean_rmse_deg=evaluation.mean_rmse_deg(scored) if scored else math.nan,
        worst_rmse_deg=evaluation.worst_rmse_deg(scored) if scored else math.nan,
        correlation=float(np.mean(related)) if related else math.nan,
        slides_rmse_m={s.name: s.rmse for s in evaluation.joints if s.unit == "m" and s.observed},
        positions_rmse_m=_positions(evaluation),
        nees=evaluation.states.nees if evaluation.states is not None else math.nan,
        coverage=evaluation.mean_coverage(banded) if banded else math.nan,
        step_us=step_us,
        kinematics_us=kinematics_us,
        joints=len(scored),
        evaluation=evaluation,
        notes=notes,
    )


def _positions(evaluation: Evaluation) -> dict[str, float]:
    """Landmarks by name without their side, `r_elbow` and `l_elbow` as `elbow`; otherwise all scored frames.

    Auxiliary frames with the same position as another, such as `r_elbow_flexed`, are left out.
    """
    sides: dict[str, list[float]] = {}
    for place in evaluation.positions:
        words = [w for w in place.frame.split("_") if w not in SIDES]
        if len(words) == 1 and words[0] in LANDMARKS:
            sides.setdefault(words[0], []).append(place.rmse_m)
    if not sides:
        sides = {place.frame: [place.rmse_m] for place in evaluation.positions}
    return {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in sides.items()}


def best(name: str, values: Mapping[str, float]) -> tuple[str, ...]:
    """The best estimators of a column, and those that are equal to the best; empty if none has a number.

    Best is the smallest error and time, the largest correlation and speed, the NEES nearest to 1 (as a ratio), and the
    coverage nearest to 95 %.
    """
    known = {who: _badness(name, value) for who, value in values.items() if math.isfinite(value)}
    if not known:
        return ()
    bound = (1.0 + LEVEL) * min(known.values()) + _LEAST_DIFFERENCE.get(name, 0.0)
    return tuple(sorted((who for who in known if known[who] <= bound), key=lambda who: known[who]))


_LEAST_DIFFERENCE = {"correlation": 1e-5, "nees_per_state": LEVEL, "coverage_95": 0.1 * LEVEL}


def _badness(name: str, value: float) -> float:
    """Distance from the ideal value; 0 is ideal."""
    if name == "correlation":
        return 1.0 - value
    if name == "steps_per_s":
        return 1.0 / value
    if name == "nees_per_state":
        return abs(math.log(value)) if value > 0 else math.inf
    return abs(value - FINE_COVERAGE) if name == "coverage_95" else value


def row_of(score_: Score) -> dict[str, Any]:
    """A score as plain data, with its whole evaluation."""
    used = score_.estimator
    return {
        "filter": used.name,
        "family": used.family,
        "title": used.title,
        "assumes": used.assumes,
        "source": used.source,
        "joints_scored": score_.joints,
        **score_.columns(),
        "notes": list(score_.notes),
        "evaluation": score_.evaluation.to_dict(),
    }
