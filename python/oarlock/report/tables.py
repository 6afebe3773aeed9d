"""Tables of the report: joints, positions, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any

import numpy as np

from oarlock.evaluation.angles import named_angles
from oarlock.evaluation.errors import seen
from oarlock.evaluation.joints import part_unit
from oarlock.evaluation.scores import Evaluation, JointScore, PositionScore, StateScore, presentation
from oarlock.model.coordinates import JointPart, parts
from oarlock.model.rotation import mean_quat, quat_from_rotvec, rotvec_between
from oarlock.report.markup import table
from oarlock.report.text import DASH, breakable, decimals, fixed, number, percent, plural
from oarlock.report.verdict import NARROW_COVERAGE, WIDE_COVERAGE
from oarlock.storage.arrays import Bools, Floats
from oarlock.tracking.track import Track


def joints_table(track: Track, evaluation: Evaluation | None) -> str:
    """Per joint: range of motion and standard deviation; with truth also error, correlation, coverage and NEES.

    Rows of components and named angles follow a ball joint, a position and the rotation of a free joint.
    """
    scored = evaluation.joints if evaluation else ()
    scores = {score.name: score for joint in scored for score in (joint, *joint.parts)}
    after_s = evaluation.start_s if evaluation else 0.0
    kept = track.time_s >= track.time_s[0] + after_s
    rows: list[list[str]] = []
    styles: dict[int, str] = {}
    several = False
    for part in parts(track.coordinate_names):
        observed = kept.any() and seen(track, part, kept)
        if not observed:
            styles[len(rows)] = "muted"
        whole, *components = _shown(track, part, kept)
        rows.append(_joint_row(whole, scores.get(part.name), observed))
        for shown in components if observed else ():
            several, styles[len(rows)] = True, "part"
            rows.append(_joint_row(shown, scores.get(shown.name), observed))
    head = ["joint", "unit", "range of motion", "mean std"]
    if evaluation:
        head += ["RMSE", "mean error", "correlation", "in 95 % band", "NEES"]
    filled = [[*row, *[DASH] * (len(head) - len(row))] for row in rows]
    return table("joints", _joints_caption(evaluation, several), head, filled, styles)


_SEVERAL = (
    " The error of a ball joint, and of the rotation of a free joint, is an angle of rotation; below it are the errors "
    "about the child's axes (rx, ry, rz) and those of its named angles, except near poles."
)


def _joints_caption(evaluation: Evaluation | None, several: bool) -> str:
    if evaluation is None:
        plain = "Joints in the order of the model: angles in degrees, lengths in millimetres."
        return plain + (" Components and named angles follow below a ball joint." if several else "")
    reference = "truth" if evaluation.reference == "truth" else "reference"
    return (
        f"Joints in the order of the model, scored without the first {evaluation.start_s:g} s: hinges in "
        "degrees, slides in millimetres. Mean std: the expected error; RMSE: the "
        "actual error; NEES: ratio of their squares, 1 if both agree, below 1 if bands are too wide. Grey: no "
        f"sensor observes this joint. ▲ marks a band that contains the {reference} less than "
        f"{percent(NARROW_COVERAGE)} of the time, "
        f"▽ a band that contains it more than {percent(WIDE_COVERAGE)}." + (_SEVERAL if several else "")
    )


@dataclass(frozen=True)
class _Shown:
    """A row: its range as text (in the unit that is shown) and its mean standard deviation, rad or m."""

    name: str
    unit: str
    extent: str
    mean_std: float


def _shown(track: Track, part: JointPart, kept: Bools) -> list[_Shown]:
    """The rows of a part: the part, then its components and named angles."""
    columns, unit = list(part.columns), part_unit(track, part)
    value, std = track.q[kept][:, columns], track.q_std[kept][:, columns]
    names = [track.coordinate_names[column] for column in columns]
    single = [
        _Shown(name, unit, _extent(value[:, k], unit), _nanmean(std[:, k])) for k, name in enumerate(names)
    ]
    if part.kind == "scalar":
        return single
    claimed = _nanmean(np.linalg.norm(std, axis=1))
    if part.kind == "position":
        return [_Shown(part.name, unit, DASH, claimed), *single]
    angles = named_angles(track, part)
    clear = kept & ~angles.near_singular
    named = [
        _Shown(name, unit, _extent(angles.value[kept, k], unit), _nanmean(angles.std[clear, k]))
        for k, name in enumerate(angles.names)
    ]
    plain = [replace(s, extent=DASH) for s in single]
    return [_Shown(part.name, unit, _reach(value), claimed), *plain, *named]


def _reach(rotvec_rad: Floats) -> str:
    """The largest distance of rotations (N, 3) from their mean, as text."""
    quat = quat_from_rotvec(rotvec_rad[np.isfinite(rotvec_rad).all(axis=1)])
    if not len(quat):
        return DASH
    away = np.linalg.norm(rotvec_between(mean_quat(quat), quat), axis=1)
    return f"within {fixed(math.degrees(float(away.max())), 1)} of its mean"


def _joint_row(shown: _Shown, score: JointScore | None, observed: bool) -> list[str]:
    factor, unit = presentation(shown.unit)
    if not observed:
        return [breakable(shown.name), unit, "not observed"]
    cells = [breakable(shown.name), unit, shown.extent, number(shown.mean_std * factor)]
    if score is None:
        return cells
    if not score.observed:
        return [*cells, escape(score.note)]
    numbers = [number(score.rmse * factor), fixed(score.bias * factor, decimals(score.rmse * factor))]
    correlation = "constant" if math.isnan(score.correlation) else fixed(score.correlation, 4)
    return [*cells, *numbers, correlation, _coverage(score.coverage), fixed(score.nees, 2)]


def _coverage(share: float) -> str:
    if share < NARROW_COVERAGE:
        return f'<span class="mark warn" title="band too narrow">▲</span> {percent(share)}'
    if share > WIDE_COVERAGE:
        return f'<span class="mark" title="band wider than needed">▽</span> {percent(share)}'
    return percent(share)


def _extent(si_value: Floats, si_unit: str) -> str:
    value = si_value * presentation(si_unit)[0]
    finite = value[np.isfinite(value)]
    return f"{fixed(float(finite.min()), 1)} to {fixed(float(finite.max()), 1)}" if len(finite) else DASH


def _nanmean(value: Floats) -> float:
    finite = value[np.isfinite(value)]
    return float(finite.mean()) if len(finite) else math.nan


def states_sentence(states: StateScore | None) -> str:
    """NEES per state over the stored beliefs, with the range of a consistent filter."""
    if states is None:
        return ""
    low, high = states.interval_95
    singular = (
        f" {plural(states.singular, 'belief')} excluded: covariance is singular." if states.singular else ""
    )
    return (
        f'<p class="hint">NEES per state, with the full covariance of angles, velocities and accelerations: '
        f"<b>{fixed(states.nees, 2)}</b> over {plural(states.beliefs, 'belief')}; 1 is expected, "
        f"{fixed(low, 2)} to {fixed(high, 2)} in 95 % of runs.{singular}</p>"
    )


def positions_table(scores: Sequence[PositionScore]) -> str:
    """Error of frame positions in root axes, mm."""
    head = [
        "frame",
        "RMSE 3D",
        *(f"{what} {k}" for what in ("RMSE", "correlation") for k in "xyz"),
        "in 95 % band",
    ]
    rows = [
        [
            breakable(score.frame),
            *(number(1e3 * v) for v in (score.rmse_m, *score.axis_rmse_m)),
            *("constant" if math.isnan(v) else fixed(v, 4) for v in score.axis_correlation),
            _coverage(score.coverage),
        ]
        for score in scores
    ]
    return table("positions", "Positions in the axes of the root, RMSE in millimetres.", head, rows)


def provenance_list(provenance: Mapping[str, Any]) -> str:
    """Provenance of the track, as a nested list of names and values."""
    items = "".join(
        f"<dt>{breakable(str(key))}</dt><dd>{_value(value)}</dd>" for key, value in provenance.items()
    )
    return f'<dl class="provenance">{items}</dl>'


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return provenance_list(value)
    if isinstance(value, (list, tuple)):
        return escape(", ".join(str(v) for v in value)) or "none"
    if isinstance(value, float):
        return number(value, 4)
    return f"<code>{breakable(str(value))}</code>"
