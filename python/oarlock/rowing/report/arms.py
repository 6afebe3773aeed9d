"""Drawings of the arms at the finish for the report: from behind and from the side, strokes and mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from oarlock.report import Axis, Series, plane_chart
from oarlock.rowing.report.drawings import SIDES, pairs
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.strokes.table import Floats

JOINTS = ("shoulder", "elbow", "wrist")
MOST_FAINT = 40
"""Number of single strokes drawn behind the mean; of more strokes an even selection is drawn."""
TOWARD_PORT, UP, TOWARD_BOW = (
    np.array(axis) for axis in ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
)


def arms_at_finish(pieces: Sequence[ReportPiece]) -> str:
    """Shoulder, elbow and wrist of both arms when the handle turns; "" where the model has no such frames."""
    held = [(piece, _arms(piece)) for piece in pieces]
    if not any(arms for _, arms in held):
        return ""
    views = (
        ("arms-behind", "From behind", Axis("toward the rower's right (port)", "m"), TOWARD_PORT),
        ("arms-side", "From the side", Axis("toward the bow", "m"), TOWARD_BOW),
    )
    figures = []
    for key, caption, across, axis in views:
        series = [
            _seen(arm.mean(axis=0), axis, _name(pieces, piece, side))
            for piece, arms in held
            for side, arm in arms.items()
        ]
        faint = (
            []
            if len(pieces) > 1
            else [
                _seen(one, axis, "")
                for _, arms in held
                for arm in arms.values()
                for one in arm[:: math.ceil(len(arm) / MOST_FAINT) or 1]
            ]
        )
        points = _points(held[0][1], axis) if len(pieces) == 1 and key == "arms-behind" else ()
        figures.append(
            plane_chart(
                key, caption, series, across, Axis("above the seat's rail, equal scales", "m"), points, faint
            )
        )
    return pairs(figures)


def _arms(piece: ReportPiece) -> dict[str, Floats]:
    """By side, (N, 3 joints, 3) m at the finish."""
    finish = piece.finish_percent
    if math.isnan(finish):
        return {}
    at = round(finish)
    found = piece.frames([f"{side}_{joint}" for side in SIDES for joint in JOINTS])
    arms = {}
    for side in SIDES:
        chain = [found[f"{side}_{joint}"][:, at] for joint in JOINTS if f"{side}_{joint}" in found]
        if len(chain) == len(JOINTS):
            arm = np.stack(chain, axis=1)
            known = np.isfinite(arm).all(axis=(1, 2))
            if known.any():
                arms[side] = arm[known]
    return arms


def _seen(arm: Floats, axis: Floats, name: str) -> Series:
    return Series(name, arm @ axis, arm @ UP)


def _name(pieces: Sequence[ReportPiece], piece: ReportPiece, side: str) -> str:
    return SIDES[side] if len(pieces) == 1 else f"{piece.name}, {SIDES[side]}"


def _points(arms: dict[str, Floats], axis: Floats) -> list[tuple[float, float, str]]:
    return [
        (float(place @ axis), float(place @ UP), joint)
        for arm in arms.values()
        for place, joint in zip(arm.mean(axis=0), JOINTS, strict=True)
    ]
