"""The shapes of a rower's track (rower, oars, boat) for the viewer.

Only the frames of the model are measured. Trunk, head, legs, hull, blades and water are drawn around them in usual
sizes: oars after the makers' lengths (Concept2), limbs after Winter's (2009) shares of stature.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model import Look, Strand, Viewpoint
from oarlock.rowing.figure.boat_shapes import boat_shapes, machine_shapes
from oarlock.rowing.figure.rower import RowerFigure
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock import Model, Track
    from oarlock.rowing.strokes.strokes import Strokes

_LIMB_M = 0.032
SEAT_TRAVEL_M = 0.62
"""Of a simulated sculler of the usual size."""
_NEEDED = ("seat", "r_shoulder", "l_shoulder", "r_hand", "l_hand")
_TRUNK_FRAMES = {"seat", "trunk_leaned", "trunk_bent", "chest", "r_shoulder", "l_shoulder"}
_CHAIN_FRAMES = {"chain_swung", "chain_raised", "chain_end"}
_SHOWN_BY_SHAPES = _TRUNK_FRAMES | _CHAIN_FRAMES | {"r_handle", "l_handle", "bar"}
_FIRST_CURVES = ("oar_phi", "handle", "seat", "trunk", "elbow_flexion")
_VIEWPOINTS = (
    Viewpoint("side", (-1.0, 0.16, 0.0)),
    Viewpoint("stern", (0.0, 0.22, 1.0)),
    Viewpoint("above", (0.0, 1.0, 0.0), 0.5),
    Viewpoint("corner", (-1.0, 0.45, 0.9), 0.85),
)


def rowing_look(track: Track) -> Look | None:
    """Shapes for a track of a rower: trunk, head, legs, oars, seat, stretcher, hull or machine, and the water.

    Args:
        track: of a model with frames `seat`, `r_shoulder`, `l_shoulder`, `r_hand`, `l_hand`; oars and hull are drawn
            if it has oarlocks, a machine if not.

    Returns:
        The look, or None for a model that is no rower.
    """
    model = track.model
    if model is None or not set(_NEEDED) <= set(model.frame_names):
        return None
    rower = RowerFigure(model, track.q)
    return _look(rower, (*rower.legs(), *rower.chain()))


@dataclass(frozen=True, eq=False)
class LiveLook:
    """Shapes of a rower whose movement is not known yet.

    Args:
        look: without strands.
        strands: legs and chain, from coordinates (T, n).
    """

    look: Look
    strands: Callable[[Floats], tuple[Strand, ...]]


def live_look(model: Model) -> LiveLook | None:
    """The look for a live session; the stretcher is where it is for a seat that moves as far as it usually does.

    Returns:
        None for a model that is no rower.
    """
    if not set(_NEEDED) <= set(model.frame_names):
        return None
    q = np.zeros((2, len(model.coordinate_names)))
    if "seat" in model.coordinate_names:
        q[1, model.coordinate_names.index("seat")] = SEAT_TRAVEL_M
    usual = RowerFigure(model, q)

    def strands(q: Floats) -> tuple[Strand, ...]:
        now = RowerFigure(model, q)
        now.toe_m = usual.toe_m
        return (*now.legs(), *now.chain())

    return LiveLook(_look(usual, ()), strands)


def _look(rower: RowerFigure, strands: tuple[Strand, ...]) -> Look:
    parts = (boat_shapes if rower.afloat else machine_shapes)(rower)
    drawn = [
        "shape of the trunk, head, legs and stretcher",
        "hull, water and feathering of the blades" if rower.afloat else "machine",
    ]
    return Look(
        shapes=(*rower.trunk_and_head(), *parts.shapes),
        strands=strands,
        viewpoints=_VIEWPOINTS if rower.afloat else _on_land(_VIEWPOINTS),
        ground_m=parts.ground_m,
        ground="water" if rower.afloat else "ground",
        limb_radius_m=_LIMB_M,
        without_lines=tuple(name for name in rower.names if name in _SHOWN_BY_SHAPES),
        fixed_lines=False,
        first_curves=_FIRST_CURVES,
        notes=tuple(drawn),
        loop_words="hands hold the handles",
    )


def _on_land(viewpoints: Iterable[Viewpoint]) -> tuple[Viewpoint, ...]:
    return tuple(Viewpoint("front", v.seen_from, v.zoom) if v.name == "stern" else v for v in viewpoints)


def stroke_marks(strokes: Strokes) -> list[tuple[float, float, str] | tuple[float, str]]:
    """Catches and finishes as instants, and each stroke as a span, for `oarlock.report.viewer.scene`.

    Args:
        strokes: what `find_strokes` found; a stroke whose end is not known has no span.
    """
    marks: list[tuple[float, float, str] | tuple[float, str]] = []
    rows = zip(strokes.catch_time_s, strokes.finish_time_s, strokes.end_time_s, strict=True)
    for number, (catch, finish, end) in enumerate(rows, 1):
        marks += [
            (float(time_s), name)
            for time_s, name in ((catch, "catch"), (finish, "finish"))
            if np.isfinite(time_s)
        ]
        if np.isfinite(catch) and np.isfinite(end):
            marks.append((float(catch), float(end), f"stroke {number}"))
    return marks
