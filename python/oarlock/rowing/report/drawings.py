"""Drawings of a rower's report: numbers over the strokes, curves and speeds over a stroke, hands, arms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.report import Axis, Mark, Series, Zone, course_chart, grid, plane_chart, row_chart
from oarlock.rowing.findings.watched import LEAST
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.piece import ReportPiece, mean_and_sd
from oarlock.rowing.report.shown import unit_of
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import NORMAL_95

TALLER = 3.0
"""Heights are enlarged by this factor, because the handle moves ten times more along the boat."""
WIDEST = 4.0
"""A drawing over the strokes spans at least this multiple of the smallest reported difference."""
STROKE = Axis("share of the stroke, from catch to next catch", "%", (0.0, 100.0))
TRENDS = (
    "rate_per_min",
    "rhythm",
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "handle_travel_m",
    "catch_factor_s",
    "catch_lean_rad",
    "finish_lean_rad",
)
CURVES = (
    "oar_angle_rad",
    "seat_position_m",
    "lean_rad",
    "elbow_flexion_rad",
    "handle_height_m",
    "oar_vertical_rad",
    "boat_acceleration_m_s2",
    "boat_speed_m_s",
)
SPEEDS = {
    "handle_speed_m_s": "handle",
    "legs_speed_m_s": "legs",
    "trunk_speed_m_s": "trunk",
    "arms_speed_m_s": "arms",
}
SIDES = {"r": "right (port)", "l": "left (starboard)"}


def pairs(figures: Sequence[str]) -> str:
    """Larger drawings, two side by side; "" without drawings."""
    return f'<div class="pair-figures">{"".join(figures)}</div>' if any(figures) else ""


NAMES_APART = 25.0
"""Percent of the stroke that two labels need side by side."""


def trends(pieces: Sequence[ReportPiece], zones: Mapping[str, Zone]) -> str:
    """Numbers of each stroke with their 95 % intervals."""
    figures = []
    for name in TRENDS:
        held = [piece for piece in pieces if name in piece.averages and piece.averages[name].known]
        if held:
            feature = feature_of(name)
            axis = Axis("", unit_of(feature), least=WIDEST * LEAST.get(feature.shown_unit, 0.0))
            figures.append(
                row_chart(
                    f"trend-{_key(name)}",
                    feature.label.capitalize(),
                    [_over_strokes(piece, name) for piece in held],
                    Axis("stroke", ""),
                    axis,
                    [zones[name]] if name in zones else (),
                )
            )
    return grid(figures)


def _key(name: str) -> str:
    return name.replace("_", "-")


def _over_strokes(piece: ReportPiece, name: str) -> Series:
    feature, kept = feature_of(name), piece.counted
    value = piece.table[name][kept] * feature.shown_scale
    half = NORMAL_95 * piece.table.std(name)[kept] * feature.shown_scale
    number = np.asarray(np.flatnonzero(kept) + 1, dtype=np.float64)
    return Series(piece.name, number, value, value - half, value + half)


def curves(pieces: Sequence[ReportPiece]) -> str:
    """All mean curves, side by side; "" without any."""
    return grid(curve_drawings(pieces))


def curve_drawings(pieces: Sequence[ReportPiece]) -> list[str]:
    """Mean and SD over the strokes: one drawing with both sides of a piece, or one per side with both pieces."""
    figures = []
    for name in CURVES:
        both = (f"r_{name}", f"l_{name}")
        sided = [n for n in both if any(n in piece.technique.curves for piece in pieces)]
        plain = [name] if any(name in piece.technique.curves for piece in pieces) else []
        apart = [(n,) for n in plain or sided]
        groups: list[tuple[str, ...]] = (
            [tuple(sided)] if sided and not plain and len(pieces) == 1 else [*apart]
        )
        figures += [_curve_figure(pieces, names) for names in groups]
    return figures


def _curve_figure(pieces: Sequence[ReportPiece], names: tuple[str, ...]) -> str:
    feature = feature_of(names[0])
    label = feature.label.rpartition(",")[0] if len(names) > 1 else feature.label
    series = [found for piece in pieces for name in names if (found := _course(piece, name))]
    says = f"{feature.sign} is positive" if feature.sign else ""
    return course_chart(
        f"curve-{_key(names[0])}",
        label.capitalize(),
        series,
        STROKE,
        Axis(says, unit_of(feature)),
        marks(pieces),
    )


def _course(piece: ReportPiece, name: str, label: str = "") -> Series | None:
    found = piece.technique.curves.get(name)
    if found is None:
        return None
    scale = feature_of(name).shown_scale
    mean, sd = found.mean * scale, found.sd * scale
    return Series(label or piece.name or SIDES.get(name[0], ""), found.percent, mean, mean - sd, mean + sd)


def speeds(pieces: Sequence[ReportPiece]) -> list[str]:
    """Speeds of handle, legs, trunk and arms: one drawing per piece; for two pieces also one per speed."""
    figures = []
    for k, piece in enumerate(pieces):
        series = [found for name, label in SPEEDS.items() if (found := _course(piece, name, label))]
        if series:
            caption = f"Handle speed by legs, trunk and arms{f', {piece.name}' if piece.name else ''}"
            axis = Axis("toward the bow, as in the drive", "m/s")
            figures.append(course_chart(f"speeds-{k}", caption, series, STROKE, axis, marks([piece])))
    if len(pieces) > 1:
        held = [name for name in SPEEDS if any(name in piece.technique.curves for piece in pieces)]
        figures += [_curve_figure(pieces, (name,)) for name in held]
    return figures


def marks(pieces: Sequence[ReportPiece]) -> list[Mark]:
    """Marks of the mean finish; one label if two would overlap."""
    ends = [piece.finish_percent for piece in pieces]
    apart = len(ends) > 1 and abs(ends[0] - ends[1]) > NAMES_APART
    names = [f"finish, {piece.name}" for piece in pieces] if apart else ["finish", ""]
    return [Mark(end, name) for end, name in zip(ends, names, strict=False)]


def hand_paths(pieces: Sequence[ReportPiece]) -> str:
    """Paths of the handles from the side and from above, mean and SD over the strokes."""
    held = []
    for piece in pieces:
        frames = piece.track.model.frame_names if piece.track.model is not None else ()
        end = "handle" if "r_handle" in frames else "hand"
        held.append((piece, piece.frames([f"{side}_{end}" for side in SIDES])))
    seen = [
        (piece, _path(path[known]), SIDES[side] if len(pieces) == 1 else f"{piece.name}, {SIDES[side]}")
        for piece, found in held
        for side in SIDES
        for name, path in found.items()
        if name.startswith(f"{side}_") and (known := np.isfinite(path).all(axis=(1, 2))).any()
    ]
    if not seen:
        return ""
    bow = Axis("toward the bow", "m")
    heights = Axis(f"above the seat's rail, drawn {TALLER:g} times as large", "m")
    events: list[tuple[float, float, str]] = []
    if len(pieces) == 1:
        finish, (mean, _) = pieces[0].finish_percent, seen[0][1]
        ends = [(0, "catch"), *([] if math.isnan(finish) else [(round(finish), "finish")])]
        events = [(float(mean[k, 0]), float(mean[k, 1]), name) for k, name in ends]
    # over the direction of the bow: the height, and the distance toward port
    aside, above = (
        [Series(name, m[:, 0], m[:, k], m[:, k] - sd[:, k], m[:, k] + sd[:, k]) for _, (m, sd), name in seen]
        for k in (1, 2)
    )
    return pairs(
        [
            plane_chart("path-side", "From the side", aside, bow, heights, events, taller=TALLER),
            plane_chart("path-above", "From above", above, bow, Axis("toward port, equal scales", "m")),
        ]
    )


def _path(path: Floats) -> tuple[Floats, Floats]:
    """Mean and SD, (POINTS, 3) each: toward the bow, up, toward port."""
    mean, sd = mean_and_sd(path)
    return mean[:, [2, 1, 0]] * np.array([-1.0, 1.0, -1.0]), sd[:, [2, 1, 0]]


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
    figures, up = [], Axis("above the seat's rail, equal scales", "m")
    for key, caption, across, axis in views:
        series = [
            _seen(arm.mean(axis=0), axis, SIDES[side] if len(pieces) == 1 else f"{piece.name}, {SIDES[side]}")
            for piece, arms in held
            for side, arm in arms.items()
        ]
        faint: list[Series] = []
        points: list[tuple[float, float, str]] = []
        for arm in held[0][1].values() if len(pieces) == 1 else ():
            faint += [_seen(one, axis, "") for one in arm[:: math.ceil(len(arm) / MOST_FAINT) or 1]]
            if key == "arms-behind":
                places = zip(arm.mean(axis=0), JOINTS, strict=True)
                points += [(float(place @ axis), float(place @ UP), joint) for place, joint in places]
        figures.append(plane_chart(key, caption, series, across, up, points, faint))
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
