"""Drawings of a rower's report: numbers over the strokes, curves and speeds over a stroke, paths of the hands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.report import Axis, Mark, Series, Zone, course_chart, grid, plane_chart, row_chart
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.watched import LEAST
from oarlock.rowing.report.averages import SIGMAS_95, feature_of
from oarlock.rowing.report.phase import mean_and_sd
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.shown import unit_of
from oarlock.rowing.strokes.table import Floats

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
    half = SIGMAS_95 * piece.table.std(name)[kept] * feature.shown_scale
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
    held = [(piece, piece.frames(_handles(piece))) for piece in pieces]
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
    events = _events(*seen[0][:2]) if len(pieces) == 1 else ()
    aside, above = ([_drawn(path, name, axis) for _, path, name in seen] for axis in (1, 2))
    return pairs(
        [
            plane_chart("path-side", "From the side", aside, bow, heights, events, taller=TALLER),
            plane_chart("path-above", "From above", above, bow, Axis("toward port, equal scales", "m")),
        ]
    )


def _handles(piece: ReportPiece) -> tuple[str, str]:
    frames = piece.track.model.frame_names if piece.track.model is not None else ()
    return ("r_handle", "l_handle") if "r_handle" in frames else ("r_hand", "l_hand")


def _path(path: Floats) -> tuple[Floats, Floats]:
    """Mean and SD, (POINTS, 3) each: toward the bow, up, toward port."""
    mean, sd = mean_and_sd(path)
    return mean[:, [2, 1, 0]] * np.array([-1.0, 1.0, -1.0]), sd[:, [2, 1, 0]]


def _drawn(path: tuple[Floats, Floats], name: str, axis: int) -> Series:
    """A path over the direction of the bow: its height (axis 1) or its distance toward port (axis 2)."""
    mean, sd = path
    across, up = mean[:, 0], mean[:, axis]
    return Series(name, across, up, up - sd[:, axis], up + sd[:, axis])


def _events(piece: ReportPiece, path: tuple[Floats, Floats]) -> list[tuple[float, float, str]]:
    finish = piece.finish_percent
    told = [(0, "catch"), *([] if math.isnan(finish) else [(round(finish), "finish")])]
    return [(float(path[0][k, 0]), float(path[0][k, 1]), name) for k, name in told]


def zone_of(feature: Feature, low: float, high: float, source: str) -> Zone:
    """A published range in the shown unit."""
    return Zone(low * feature.shown_scale, high * feature.shown_scale, source)
