"""The piece as drawings: numbers over the strokes, curves over a stroke, paths of the hands, arms at the finish."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from oarlock.report import Axis, Mark, Series, Zone, course_chart, plane_chart, row_chart
from oarlock.rowing.report.averages import SIGMAS_95, counted, feature_of
from oarlock.rowing.report.phase import mean_and_sd
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import unit_of
from oarlock.rowing.report.standing_out import LEAST
from oarlock.rowing.stroke_table import Floats

DEGREES = 180.0 / math.pi
TALLER = 3.0
"""A hand rises and falls by a tenth of its way: heights are drawn larger."""
WIDEST = 4.0
"""A drawing over the strokes spans at least so many times what is worth telling: noise is not blown up."""
STROKE = Axis("share of the stroke, from catch to catch", "%", (0.0, 100.0))
TRENDS = ("rate_per_min", "rhythm", "catch_angle_rad", "finish_angle_rad", "arc_rad", "catch_factor_s")
SIDES = {"r": "right (port)", "l": "left (starboard)"}


class Curve(NamedTuple):
    """A course to draw: caption, what its axis says, unit, factor from SI, and joints; of two sides both."""

    caption: str
    says: str
    unit: str
    factor: float
    joints: tuple[str, ...]


CURVES = (
    Curve("Oar angle", "catch negative, finish positive", "deg", DEGREES, ("r_oar_phi", "l_oar_phi")),
    Curve("Oar angle", "catch negative, finish positive", "deg", DEGREES, ("oar_phi",)),
    Curve("Handle", "toward the rower", "m", 1.0, ("handle",)),
    Curve("Seat", "toward the feet", "m", 1.0, ("seat",)),
    Curve("Trunk lean", "back is positive", "deg", DEGREES, ("trunk",)),
    Curve("Elbow flexion", "bent is positive", "deg", DEGREES, ("r_elbow_flexion", "l_elbow_flexion")),
    Curve("Shoulder flexion", "arm forward", "deg", DEGREES, ("r_shoulder_flexion", "l_shoulder_flexion")),
    Curve(
        "Shoulder abduction",
        "away from the body",
        "deg",
        DEGREES,
        ("r_shoulder_abduction", "l_shoulder_abduction"),
    ),
    Curve("Oar height angle", "handle up is positive", "deg", DEGREES, ("r_oar_alpha", "l_oar_alpha")),
)


def grid(figures: Sequence[str]) -> str:
    """Drawings beside each other."""
    return f'<div class="grid-figures">{"".join(figures)}</div>'


def trends(pieces: Sequence[Piece], zones: dict[str, Zone]) -> str:
    """Numbers stroke by stroke with the 95 % interval of each."""
    figures = []
    for name in TRENDS:
        held = [piece for piece in pieces if name in piece.table and np.isfinite(piece.table[name]).any()]
        if held:
            feature = feature_of(name)
            series = [_over_strokes(piece, name) for piece in held]
            zone = (zones[name],) if name in zones else ()
            figures.append(
                row_chart(
                    f"trend-{name.replace('_', '-')}",
                    feature.label.capitalize(),
                    series,
                    Axis("stroke", ""),
                    Axis("", unit_of(feature), least=WIDEST * LEAST.get(feature.shown_unit, 0.0)),
                    zone,
                )
            )
    return grid(figures)


def _over_strokes(piece: Piece, name: str) -> Series:
    feature, kept = feature_of(name), counted(piece.table) > 0.5
    value = piece.table[name][kept] * feature.shown_scale
    half = SIGMAS_95 * piece.table.std(name)[kept] * feature.shown_scale
    return Series(
        piece.name, np.asarray(np.flatnonzero(kept) + 1, dtype=np.float64), value, value - half, value + half
    )


def curves(pieces: Sequence[Piece]) -> str:
    """Mean and SD over the strokes: both sides of one piece in a drawing, or both pieces."""
    figures = []
    for k, curve in enumerate(CURVES):
        for j, joints in enumerate([curve.joints] if len(pieces) == 1 else [(n,) for n in curve.joints]):
            series = [found for piece in pieces for name in joints if (found := _course(piece, name, curve))]
            if series:
                side = SIDES.get(joints[0][0], "") if len(joints) == 1 and joints[0][1] == "_" else ""
                figures.append(
                    course_chart(
                        f"curve-{k}-{j}",
                        f"{curve.caption}{f', {side}' if side else ''}",
                        series,
                        STROKE,
                        Axis(curve.says, curve.unit),
                        marks(pieces),
                    )
                )
    return grid(figures)


def _course(piece: Piece, joint: str, curve: Curve) -> Series | None:
    found = piece.joint(joint)
    if found is None:
        return None
    side = SIDES.get(joint[0], "") if joint[1] == "_" else ""
    mean, sd = found.mean * curve.factor, found.sd * curve.factor
    return Series(piece.name or side, found.percent, mean, mean - sd, mean + sd)


def marks(pieces: Sequence[Piece]) -> list[Mark]:
    """Where the drive ends on average."""
    names = ["finish"] if len(pieces) == 1 else [f"finish {k + 1}" for k in range(len(pieces))]
    return [Mark(piece.strokes.finish_percent, name) for piece, name in zip(pieces, names, strict=True)]


def hand_paths(pieces: Sequence[Piece]) -> str:
    """Paths of the handles from the side and from above, mean and SD over the strokes."""
    held = [(piece, piece.frames(_handles(piece))) for piece in pieces]
    bow = Axis("toward the bow", "m")
    seen = [
        (piece, found, side, hand if len(pieces) == 1 else f"{piece.name}, {hand}")
        for piece, found in held
        for side, hand in SIDES.items()
        if _has(found, side)
    ]
    if not seen:
        return ""
    aside = [_drawn(found, side, name, 1) for _, found, side, name in seen]
    above = [_drawn(found, side, name, 2) for _, found, side, name in seen]
    heights = Axis(f"above the seat's rail, drawn {TALLER:g} times as large", "m")
    events = _events(*seen[0][:3]) if len(pieces) == 1 else ()
    figures = [
        plane_chart("path-side", "From the side", aside, bow, heights, events, taller=TALLER),
        plane_chart("path-above", "From above", above, bow, Axis("toward port, one scale", "m")),
    ]
    return f'<div class="pair-figures">{"".join(figures)}</div>'


def _handles(piece: Piece) -> tuple[str, str]:
    frames = piece.track.model.frame_names if piece.track.model is not None else ()
    return ("r_handle", "l_handle") if "r_handle" in frames else ("r_hand", "l_hand")


def _has(found: dict[str, Floats], side: str) -> bool:
    return any(name.startswith(f"{side}_") and np.isfinite(path).all() for name, path in found.items())


def _path(found: dict[str, Floats], side: str) -> tuple[Floats, Floats]:
    """Mean and SD, (POINTS, 3) each: toward the bow, up, toward port."""
    path = next(path for name, path in found.items() if name.startswith(f"{side}_"))
    mean, sd = mean_and_sd(path)
    seen = mean[:, [2, 1, 0]] * np.array([-1.0, 1.0, -1.0])
    return seen, sd[:, [2, 1, 0]]


def _drawn(found: dict[str, Floats], side: str, name: str, axis: int) -> Series:
    """A path over the bow's direction: its height (axis 1) or how far it is toward port (2)."""
    mean, sd = _path(found, side)
    across, up = mean[:, 0], mean[:, axis]
    return Series(name, across, up, up - sd[:, axis], up + sd[:, axis])


def _events(piece: Piece, found: dict[str, Floats], side: str) -> list[tuple[float, float, str]]:
    mean, _ = _path(found, side)
    finish = piece.strokes.finish_percent
    told = [(0, "catch")] + ([] if math.isnan(finish) else [(round(finish), "finish")])
    return [(float(mean[k, 0]), float(mean[k, 1]), name) for k, name in told]
