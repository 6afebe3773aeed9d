"""`technique`: technique of a track, with numbers per stroke, uncertainty, means, curves and targets."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import PathLike, cpu_count
from types import MappingProxyType

import numpy as np

from oarlock import Calibration, Track
from oarlock.rowing.analysis.features import CURVES, FEATURES, NUMBERS, Feature
from oarlock.rowing.analysis.observed_posture import SEEN_SHARE, observed_q
from oarlock.rowing.analysis.posture_errors import SHAPES, Events, Scatter
from oarlock.rowing.analysis.rower_places import SIDES, RowerFrames
from oarlock.rowing.analysis.stroke_grid import CoordinateCurves, PhaseGrid
from oarlock.rowing.analysis.stroke_means import (
    FeatureMean,
    PhaseCurve,
    feature_means,
    phase_curves,
    side_differences,
)
from oarlock.rowing.analysis.stroke_values import Values, boat_values
from oarlock.rowing.analysis.targets import Target, load_targets
from oarlock.rowing.analysis.timing_factors import timing_factors
from oarlock.rowing.analysis.unknown_features import reasons
from oarlock.rowing.strokes.find_strokes import find_strokes
from oarlock.rowing.strokes.strokes import Strokes
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

SETTLED_S = 2.0
"""As `evaluate` scores tracks: until then errors are larger than the filter can know."""
_YOUNG = f"it began in the first {SETTLED_S:.0f} s of filtering"
_STROKES_AT_ONCE = 8
"""Ctrl-C waits for the parts at work: fewer strokes are less efficient, more take over a second."""
_ARM = ("elbow", "shoulder", "arm_plane", "forearm")


@dataclass(frozen=True, eq=False)
class Technique:
    """Technique of a track.

    Attributes:
        strokes: a row a stroke, with standard deviations, reasons, and each stroke's curves (101,) from catch to
            next catch.
        features: definition of each column and curve.
        summary: over the strokes that count, by column: mean, spread from stroke to stroke, and the uncertainty that
            averaging does not remove.
        symmetry: by column without its side: right minus left.
        curves: over the strokes that count, by name.
        targets: by column; empty if none were asked for.
        found: the strokes used.
        notes: sentences about missing data.
    """

    strokes: StrokeTable
    features: Mapping[str, Feature]
    summary: Mapping[str, FeatureMean]
    symmetry: Mapping[str, FeatureMean]
    curves: Mapping[str, PhaseCurve]
    targets: Mapping[str, Target]
    found: Strokes
    notes: tuple[str, ...]


def technique(
    track: Track,
    strokes: Strokes | None = None,
    targets: str | PathLike[str] | None = None,
    *,
    calibration: Calibration | None = None,
    mean_speed_m_s: float | None = None,
) -> Technique:
    """Compute the technique of a track.

    Works for scullers, sweep rowers and ergometers, with or without oars; unknown numbers are NaN, with the reason in
    `Technique.strokes.reasons`. Standard deviations cover those of the track's angles, of lengths and rig (the model's
    `std`), of encoders' zeros and of the strokes' times; see `posture_errors` for how they are joined.

    Args:
        track: of a model with a rower's frames (`sculler`, `sweep`, `ergometer` and their like).
        strokes: None finds them in the track. Of a filtered track those of its first 2 s are left out of averages.
        targets: a boat class of `oarlock.rowing.TARGET_CLASSES`, such as "sculling_men", or a file of one's own.
        calibration: with which the track was made, for its lengths' standard deviations; None: the model's.
        mean_speed_m_s: of the boat; without it fluctuations of its speed are in m/s only.

    Raises:
        DataError: the track has no model, is not a rower, has no strokes, or no such targets.
    """
    if track.model is None:
        raise DataError("technique: this track was loaded without its model; load the model file again")
    rower = RowerFrames(track.model)
    found = _settled(track, find_strokes(track) if strokes is None else strokes)
    values, stds = _values(track, rower, found, _lengths_std(rower, calibration), mean_speed_m_s)
    _forget_unobserved(track, rower, found, values, stds)
    table, per_stroke = _table(track, found, values, stds)
    counted = found.in_averages
    return Technique(
        strokes=table,
        features=MappingProxyType({name: FEATURES[name] for name in (*table.columns, *per_stroke)}),
        summary=feature_means(table, counted),
        symmetry=side_differences(table, counted),
        curves=phase_curves(_grid(found), values, stds, counted, per_stroke),
        targets=MappingProxyType({} if targets is None else load_targets(targets)),
        found=found,
        notes=tuple(dict.fromkeys((*found.notes, *track.notes))),
    )


def _settled(track: Track, found: Strokes) -> Strokes:
    """Of a filtered track, without the strokes that began while the filter did not know its errors yet."""
    if track.smoothed or track.info is None or track.provenance.get("resumed", False):
        return found
    young = found.catch_time_s < track.time_s[0] + SETTLED_S
    left_out = (
        (reason or _YOUNG) if begins else reason for reason, begins in zip(found.left_out, young, strict=True)
    )
    return replace(found, left_out=tuple(left_out))


def _grid(found: Strokes) -> PhaseGrid:
    return PhaseGrid.of(found.catch_time_s, found.finish_time_s, found.end_time_s)


def _events(found: Strokes) -> Events:
    return Events(
        found.catch_time_s,
        found.finish_time_s,
        found.end_time_s,
        found.catch_time_std_s,
        found.finish_time_std_s,
        np.nan_to_num(found.end_time_std_s),
    )


def _lengths_std(rower: RowerFrames, calibration: Calibration | None) -> dict[str, float]:
    known = {row.name: float(row.std or 0.0) for row in rower.model.describe().parameters}
    return known | dict({} if calibration is None else calibration.parameter_stds)


def _values(
    track: Track, rower: RowerFrames, found: Strokes, lengths: dict[str, float], mean_speed_m_s: float | None
) -> tuple[Values, Values]:
    if len(found) == 0:
        return {}, {}
    course, events = CoordinateCurves(track, observed_q(track, rower)), _events(found)

    def part(first: int) -> tuple[Values, Values]:
        own = events.part(slice(first, first + _STROKES_AT_ONCE))
        return Scatter(rower, course, own, found.zero_std, lengths).values_and_stds()

    # The engine and numpy compute without Python's lock.
    with ThreadPoolExecutor(min(cpu_count() or 1, 4)) as pool:
        parts = list(pool.map(part, range(0, len(found), _STROKES_AT_ONCE)))
    values, stds = (_joined([part[which] for part in parts]) for which in (0, 1))
    boat, boat_stds = _boat(track, _grid(found), mean_speed_m_s)
    oars, oar_stds = _oars(rower, course, _grid(found), found.zero_std)
    values |= boat | oars
    stds |= boat_stds | oar_stds
    for name, (value, std) in timing_factors(track, found).items():
        values[name], stds[name] = value, std
    return values, stds


def _joined(parts: list[Values]) -> Values:
    names = dict.fromkeys(name for part in parts for name in part)
    count = [len(next(iter(part.values()))) for part in parts]
    joined = {}
    for name in names:
        like = next(part[name] for part in parts if name in part)
        rows = [
            part.get(name, np.full((n, *like.shape[1:]), np.nan))
            for part, n in zip(parts, count, strict=True)
        ]
        joined[name] = np.concatenate(rows)
    return joined


def _boat(track: Track, grid: PhaseGrid, mean_speed_m_s: float | None) -> tuple[Values, Values]:
    if "surge" not in track.slow:
        return {}, {}
    surge = track.slow["surge"]
    known = np.isfinite(grid.time_s)
    value, std = (np.full(grid.time_s.shape, np.nan) for _ in range(2))
    value[known] = np.interp(grid.time_s[known], track.time_s, surge.value)
    std[known] = np.interp(grid.time_s[known], track.time_s, np.nan_to_num(surge.std))
    values = boat_values(grid, value, mean_speed_m_s)
    squares = {name: np.zeros_like(v) for name, v in values.items()}
    for shape in SHAPES:
        up, down = (boat_values(grid, value + sign * std * shape, mean_speed_m_s) for sign in (1.0, -1.0))
        for name in values:
            squares[name] += 0.25 * (up[name] - down[name]) ** 2
    return values, {name: np.sqrt(square) for name, square in squares.items()}


def _oars(
    rower: RowerFrames, course: CoordinateCurves, grid: PhaseGrid, zero_std: float
) -> tuple[Values, Values]:
    q, _, stds, _ = course.at(grid)
    names = list(rower.model.coordinate_names)
    values, found_stds = {}, {}
    for side, phi in rower.oars.items():
        for joint, name in ((phi, "oar_angle_rad"), (phi.replace("phi", "alpha"), "oar_vertical_rad")):
            if joint in names:
                column, own = names.index(joint), f"{side}_{name}" if side else name
                values[own] = q[..., column]
                found_stds[own] = np.hypot(stds[..., column], zero_std)
    return values, found_stds


def _forget_unobserved(
    track: Track, rower: RowerFrames, found: Strokes, values: Values, stds: Values
) -> None:
    """Numbers that depend on unobserved coordinates come from the prior alone and are not reported."""
    known = list(track.coordinate_names)
    told_by = [
        (("lean", "trunk", "arms_", "finish_factor"), "", rower.trunk_joints),
        (("seat", "legs", "share", "style", "catch_factor"), "", ("seat",)),
        *((_ARM, f"{side}_", rower.arm_joints(side)) for side in SIDES),
    ]
    for words, side, joints in told_by:
        unseen = _unseen(track, found, [known.index(name) for name in joints if name in known])
        for name in values:
            sided = name.startswith(("r_", "l_"))
            own = name.startswith(side) if side else not sided
            if own and any(word in name for word in words):
                values[name][unseen], stds[name][unseen] = np.nan, np.nan


def _unseen(track: Track, found: Strokes, columns: list[int]) -> Bools:
    """Strokes in more than half of which a coordinate is not observed."""
    edges = np.searchsorted(track.time_s, [found.catch_time_s, found.finish_time_s])
    seen = track.observed[:, columns].all(axis=1)
    total = np.concatenate([[0], np.cumsum(seen)])
    length = np.maximum(edges[1] - edges[0], 1)
    return np.asarray((total[edges[1]] - total[edges[0]]) / length < SEEN_SHARE)


def _table(track: Track, found: Strokes, values: Values, stds: Values) -> tuple[StrokeTable, tuple[str, ...]]:
    plain = found.table()
    own = [name for name in NUMBERS if name not in plain.columns]
    unknown = np.full(len(found), np.nan)
    columns = dict(plain.columns) | {name: values.get(name, unknown) for name in own}
    own_stds = {name: stds.get(name, unknown) for name in own}
    told = dict(plain.reasons) | reasons(track, found, {name: columns[name] for name in own})
    curves = {name: values[name] for name in CURVES if name in values}
    grid = _grid(found)
    normal = {name: tuple(_hundred(grid, rows)) for name, rows in curves.items()}
    ordered = [name for name in FEATURES if name in columns]
    table = StrokeTable(
        {name: columns[name] for name in ordered},
        {name: std for name, std in (dict(plain.stds) | own_stds).items() if name in columns},
        {name: rows for name, rows in told.items() if any(rows)},
        normal,
        source=plain.source,
        notes=plain.notes,
        epoch=plain.epoch,
    )
    return table, tuple(curves)


def _hundred(grid: PhaseGrid, rows: Floats) -> Floats:
    """Curves (N, 101) at 0 to 100 % of the time from catch to next catch."""
    percent = np.linspace(0.0, 1.0, 101)
    return np.array(
        [
            np.interp(percent, phase, row) if np.isfinite(phase).all() else np.full(101, np.nan)
            for phase, row in zip(grid.phase, rows, strict=True)
        ]
    ).reshape(len(grid), 101)
