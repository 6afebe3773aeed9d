"""Converts a track to the data of the viewer: points over time, connections, uncertainty, curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oarlock.model.description import WorldDescription
from oarlock.model.shapes import Look, Viewpoint
from oarlock.recording.session_info import session_info, session_text
from oarlock.report.viewer.curves import Curve, joint_curves, packed_panels
from oarlock.report.viewer.figure import Figure, add_frames, add_loops, add_strands, carried_shapes
from oarlock.report.viewer.marks import Mark, marks_and_spans
from oarlock.report.viewer.packing import packed, packed_times
from oarlock.storage.arrays import Bools, Floats, Ints
from oarlock.storage.epoch import ZONE_WORDS, moment_of
from oarlock.storage.errors import DataError
from oarlock.tracking.places import model_of, poses_of, position_spreads
from oarlock.tracking.track import Track

Scene = dict[str, Any]

FORMAT = 1
SHOWN_EVERY_S = 0.025
"""Time between shown samples, s; the player interpolates linearly between them."""
SPREAD_EVERY_S = 0.1
"""Time between shown ellipsoids, s; they change more slowly."""


def scene(
    track: Track,
    *,
    marks: Sequence[Mark] = (),
    curves: Sequence[Curve] | None = None,
    ghost: Track | Mapping[str, Any] | None = None,
    every_s: float | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    look: Look | None = None,
    title: str = "",
) -> Scene:
    """Everything that the player needs of a track, as dictionaries, lists, texts and numbers.

    Samples are selected, not interpolated: each position is that of `Track.frame_positions` at a time of the track.

    Args:
        track: what to draw; it needs its model.
        marks: instants `(time_s, label)` and spans `(start_s, end_s, label)`.
        curves: curves beside the figure; None: every joint.
        ghost: another track, or its scene, to draw over this one.
        every_s: time between shown samples, s; None: 0.025, or the track's own step if that is longer.
        start_s: start of the shown interval, s; None: the track's start.
        end_s: end of the shown interval, s.
        look: shapes, viewpoints and ground of the field of application.
        title: a line above the figure; if empty, who was recorded and when, as far as it is known.

    Raises:
        DataError: no model, no samples in the interval, a shape on a missing frame, invalid marks or curves.
    """
    model = model_of(track, "scene")
    seen = Look() if look is None else look
    rows = shown_rows(track.time_s, SHOWN_EVERY_S if every_s is None else every_s, start_s, end_s)
    for shape in seen.shapes:
        if shape.frame not in model.frame_names:
            raise DataError(
                f'scene: shape "{shape.label}" is attached to frame "{shape.frame}", which the model does not have; '
                f"it has {', '.join(model.frame_names)}"
            )
    description = model.describe()
    poses = poses_of(track, rows)
    figure = Figure()
    bones = add_frames(figure, description, poses, seen)
    loops = add_loops(figure, description, poses)
    framed = len(figure.places)
    strands = add_strands(figure, seen, rows)
    shapes, turns, origins = carried_shapes(figure, seen, list(model.frame_names), poses)
    points, places = figure.described()
    instants, spans = marks_and_spans(marks)
    times = track.time_s[rows]
    chosen = joint_curves(track) if curves is None else tuple(curves)
    return {
        "format": FORMAT,
        "title": title or session_text(session_info(track.provenance)),
        "model": model.name,
        "time_s": packed_times(times),
        "epoch": _epoch(track),
        "world": {"up": list(description.world.up), "forward": list(description.world.forward)},
        "ground": {"kind": seen.ground, "height_m": seen.ground_m},
        "viewpoints": viewpoints_of(seen, description.world),
        "limb_radius_m": seen.limb_radius_m,
        "points": points,
        "places_m": packed(places),
        "bones": bones,
        "loops": loops,
        "loop_words": seen.loop_words,
        "strands": strands,
        "shapes": shapes,
        "carriers": {"points": origins, "quat_wxyz": packed(turns)},
        "spread": _spread(track, figure, model.frame_names, rows, framed),
        "panels": packed_panels(chosen, rows, len(track.time_s), seen.first_curves),
        "marks": instants,
        "spans": [span for span in spans if span["start_s"] < times[-1] and span["end_s"] > times[0]],
        "notes": list(seen.notes),
        "ghost": scene(ghost, every_s=every_s, look=look and look.bare())
        if isinstance(ghost, Track)
        else ghost,
    }


def viewpoints_of(look: Look, world: WorldDescription) -> list[dict[str, Any]]:
    """Where the figure is seen from: the look's viewpoints, or the usual ones of a world."""
    return [
        {"name": one.name, "seen_from": [float(v) for v in one.seen_from], "zoom": float(one.zoom)}
        for one in look.viewpoints or _usual(world)
    ]


def _epoch(track: Track) -> dict[str, Any] | None:
    """The moment of time 0 as the player's clock needs it: ms since 1970 or midnight, and the words of its zone."""
    moment = moment_of(track.provenance.get("epoch"))
    if moment is None:
        return None
    return {"ms": 1e3 * moment.seconds, "dated": moment.kind != "clock", "zone": ZONE_WORDS[moment.kind]}


def shown_rows(time_s: Floats, every_s: float, start_s: float | None, end_s: float | None) -> Ints:
    """Rows of the track that are shown: the first, the nearest to each further time step, and the last.

    Raises:
        DataError: the interval contains no sample, or `every_s` is not a positive number.
    """
    if not every_s > 0.0 or not np.isfinite(every_s):
        raise DataError(f"scene: every_s is {every_s}; give the time between shown samples, s, above 0")
    first = -np.inf if start_s is None else start_s
    last = np.inf if end_s is None else end_s
    inside = np.flatnonzero((time_s >= first) & (time_s <= last))
    if not inside.size:
        span = f"{time_s[0]:.3f} to {time_s[-1]:.3f} s" if len(time_s) else "nothing"
        raise DataError(f"scene: no sample from {first} to {last} s; the track covers {span}")
    stretch = time_s[inside]
    step = float(np.median(np.diff(stretch))) if len(stretch) > 1 else every_s
    if step >= 0.75 * every_s:
        return inside
    slot = np.rint((stretch - stretch[0]) / every_s)
    off = np.abs(stretch - stretch[0] - slot * every_s)
    # the nearest sample of each slot: first by slot, then by distance
    order = np.lexsort((off, slot))
    kept = inside[np.sort(order[np.unique(slot[order], return_index=True)[1]])]
    return np.union1d(kept, inside[-1:])


def _spread(
    track: Track, figure: Figure, frame_names: Sequence[str], rows: Ints, framed: int
) -> Scene | None:
    """Lower Cholesky factors of the points' covariances at a lower rate; None without covariances."""
    asked = [k for k in range(framed) if figure.frames[k]]
    numbers = [list(frame_names).index(figure.frames[k][0]) for k in asked]
    times = track.time_s[rows]
    few = rows[shown_rows(times, SPREAD_EVERY_S, None, None)]
    covariance, source = position_spreads(track, numbers, 0, few)
    known = np.asarray(np.isfinite(covariance).all(axis=(2, 3)))
    uncertain = [k for k in range(len(asked)) if known[:, k].any() and np.nanmax(covariance[:, k]) > 0.0]
    if source == "unknown" or not uncertain:
        return None
    factors = [_factor(covariance[:, k], known[:, k]) for k in uncertain]
    return {
        "points": [asked[k] for k in uncertain],
        "time_s": packed_times(track.time_s[few]),
        "factors_m": packed(np.concatenate(factors, axis=1)),
        "source": source,
    }


def _factor(covariance: Floats, known: Bools) -> Floats:
    """Rows (N, 6) of the lower factor L, C = L L': xx, yx, yy, zx, zy, zz, m; NaN where C is not known."""
    factors = np.full((len(covariance), 6), np.nan)
    # with a direction of zero variance the factor is not unique
    least = 1e-14 * np.eye(3)
    factors[known] = np.linalg.cholesky(covariance[known] + least)[:, *np.tril_indices(3)]
    return factors


def _usual(world: WorldDescription) -> tuple[Viewpoint, ...]:
    """Views from its right side, from the front, and from above."""
    up, forward = np.asarray(world.up, dtype=np.float64), np.asarray(world.forward, dtype=np.float64)
    right = np.cross(forward, up)
    directions = {"side": right + 0.12 * up, "front": forward + 0.12 * up, "above": up}
    return tuple(Viewpoint(name, tuple(float(v) for v in where)) for name, where in directions.items())  # type: ignore[arg-type]
