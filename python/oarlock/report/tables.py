"""Tables: joints, positions, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ..evaluate import Evaluation, JointScore, PositionScore, StateScore, presentation
from ..evaluate.tracklike import Floats, TrackLike
from .text import DASH, breakable, decimals, fixed, number, percent, plural
from .verdict import NARROW_COVERAGE, WIDE_COVERAGE


def table(
    key: str, caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], muted: Sequence[int] = ()
) -> str:
    """A table whose first column is a row header; cells are markup already. ``muted`` rows are greyed."""
    header = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    body = "".join(_row(cells, i in muted) for i, cells in enumerate(rows))
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-labelledby="{key}-caption">'
        f'<table id="{key}-table"><caption id="{key}-caption"><span>{escape(caption)}</span></caption>'
        f"<thead><tr>{header}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    )


def _row(cells: Sequence[str], muted: bool) -> str:
    first, *others = cells
    style = ' class="muted"' if muted else ""
    return f'<tr{style}><th scope="row">{first}</th>{"".join(f"<td>{cell}</td>" for cell in others)}</tr>'


def joints_table(track: TrackLike, evaluation: Evaluation | None) -> str:
    """Per joint: range of motion and band; with truth also error, correlation, coverage and NEES."""
    scores = {score.name: score for score in evaluation.joints} if evaluation else {}
    after_s = evaluation.start_s if evaluation else 0.0
    kept = track.time_s >= track.time_s[0] + after_s
    rows, muted = [], []
    for i, name in enumerate(track.joint_names):
        seen = bool(np.mean(track.observed[kept, i]) >= 0.5) if kept.any() else False
        if not seen:
            muted.append(i)
        rows.append(_joint_row(track, i, kept, scores.get(name), seen))
    head = ["joint", "unit", "range of motion", "mean std"]
    if evaluation:
        head += ["RMSE", "mean error", "correlation", "in 95 % band", "NEES"]
    return table("joints", _joints_caption(evaluation), head, _aligned(rows, len(head)), muted)


def _joints_caption(evaluation: Evaluation | None) -> str:
    if evaluation is None:
        return "Joints in the order of the model: hinges in degrees, slides in millimetres."
    reference = "truth" if evaluation.reference == "truth" else "reference"
    return (
        f"Joints in the order of the model, scored without the first {evaluation.start_s:g} s: hinges in degrees, "
        "slides in millimetres. Mean std is what the track claims, RMSE what it does. NEES is 1 when both agree. "
        f"▲ marks a band that holds the {reference} less than {percent(NARROW_COVERAGE)} of the time, "
        f"▽ one that does so more than {percent(WIDE_COVERAGE)}."
    )


def _joint_row(track: TrackLike, i: int, kept: Floats, score: JointScore | None, seen: bool) -> list[str]:
    name = track.joint_names[i]
    factor, unit = presentation(track[name].unit)
    if not seen:
        return [breakable(name), unit, "not observed"]
    value, std = track.q[kept, i] * factor, track.q_std[kept, i] * factor
    cells = [breakable(name), unit, _extent(value), number(_nanmean(std))]
    if score is None:
        return cells
    if not score.observed:
        return [*cells, escape(score.note)]
    numbers = [number(score.rmse * factor), fixed(score.bias * factor, decimals(score.rmse * factor))]
    correlation = "constant" if math.isnan(score.correlation) else fixed(score.correlation, 4)
    return [*cells, *numbers, correlation, _coverage(score.coverage), fixed(score.nees, 2)]


def _aligned(rows: Sequence[Sequence[str]], width: int) -> list[list[str]]:
    return [[*row, *[DASH] * (width - len(row))] for row in rows]


def _coverage(share: float) -> str:
    if share < NARROW_COVERAGE:
        return f'<span class="mark warn" title="band too narrow">▲</span> {percent(share)}'
    if share > WIDE_COVERAGE:
        return f'<span class="mark" title="band wider than needed">▽</span> {percent(share)}'
    return percent(share)


def _extent(value: Floats) -> str:
    finite = value[np.isfinite(value)]
    return f"{fixed(float(finite.min()), 1)} to {fixed(float(finite.max()), 1)}" if len(finite) else DASH


def _nanmean(value: Floats) -> float:
    finite = value[np.isfinite(value)]
    return float(finite.mean()) if len(finite) else math.nan


def states_sentence(states: StateScore | None) -> str:
    """NEES per state over the kept beliefs, with what a consistent filter would show."""
    if states is None:
        return ""
    low, high = states.interval_95
    singular = (
        f" {plural(states.singular, 'belief')} left out: no full-rank covariance." if states.singular else ""
    )
    return (
        f'<p class="hint">NEES per state, with the full covariance of angles, velocities and accelerations: '
        f"<b>{fixed(states.nees, 2)}</b> over {plural(states.beliefs, 'belief')}; 1 is expected, "
        f"{fixed(low, 2)} to {fixed(high, 2)} in 95 % of runs.{singular}</p>"
    )


def positions_table(scores: Sequence[PositionScore]) -> str:
    """Error of frame positions in root axes, mm."""
    head = ["frame", "RMSE 3D", *(f"RMSE {k}" for k in "xyz"), *(f"correlation {k}" for k in "xyz")]
    rows = [
        [
            breakable(score.frame),
            *(number(1e3 * v) for v in (score.rmse_m, *score.axis_rmse_m)),
            *("constant" if math.isnan(v) else fixed(v, 4) for v in score.axis_correlation),
        ]
        for score in scores
    ]
    return table("positions", "Positions in the axes of the root, RMSE in millimetres.", head, rows)


def provenance_list(provenance: Mapping[str, Any]) -> str:
    """What made this track, as a nested list of names and values."""
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
