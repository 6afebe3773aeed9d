"""Points of the viewer's figure over time, and their connections: bones, loops, shapes, strands."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from oarlock.model.description import ModelDescription, Vector
from oarlock.model.rotation import continuous_quat, quat_from_matrix
from oarlock.model.shapes import Look
from oarlock.report.viewer.sides import side_of
from oarlock.storage.arrays import Floats, Ints

SAME_PLACE_M = 1e-6
"""Points that are always closer than this are one point."""
NAMED_JOINTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "neck")
"""Joints whose names people know: a segment's origin is the joint that moves it, so it has the joint's name."""
STILL_M = 1e-9
"""A point that moves by less is drawn as fixed."""


@dataclass(eq=False)
class Figure:
    """Points (T, 3) each, by number, and their connections; frames, loops and strands add to them.

    A point has the names of the frames there, and a label for people if it is a joint with a name.
    """

    places: list[Floats] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    frames: list[list[str]] = field(default_factory=list)
    labels: dict[int, str] = field(default_factory=dict)

    def point(self, place: Floats, name: str, frame: str | None = None) -> int:
        """Number of the point at this position (T, 3); the first point there gives the name."""
        found = next((k for k, other in enumerate(self.places) if _same(other, place)), None)
        if found is None:
            found = len(self.places)
            self.places.append(place)
            self.names.append(name)
            self.frames.append([])
        if frame is not None:
            self.frames[found].append(frame)
        return found

    def described(self) -> tuple[list[dict[str, Any]], Floats]:
        """The points as plain data, and the positions (T, 3 M) of the moving ones."""
        points, moving = [], []
        for k, (place, name, frames) in enumerate(zip(self.places, self.names, self.frames, strict=True)):
            moves = np.isnan(place).any() or np.ptp(place, axis=0).max(initial=0.0) > STILL_M
            still = None if moves else [float(value) for value in place[0]]
            label = self.labels.get(k, "")
            points.append(
                {"name": name, "frames": frames, "label": label, "side": side_of(name)[0], "still": still}
            )
            if still is None:
                moving.append(place)
        return points, np.concatenate(moving, axis=1) if moving else np.zeros((len(self.places[0]), 0))


def add_frames(
    figure: Figure, description: ModelDescription, poses: Floats, look: Look
) -> list[dict[str, Any]]:
    """Adds points of all frames, and the bones from each to its parent, except those that the look hides."""
    frames = description.frames
    kinds = {joint.name: joint.kind for joint in description.joints}
    number = {frame.name: k for k, frame in enumerate(frames)}
    moves: set[str] = set()
    bones: list[dict[str, Any]] = []
    for k, frame in enumerate(frames):
        end = figure.point(poses[:, k, :3, 3], frame.name, frame.name)
        if words := _joint_words(frame.joint or ""):
            figure.labels.setdefault(end, words)
        if frame.joint is not None or frame.parent in moves:
            moves.add(frame.name)
        kind = kinds.get(frame.joint or "", "fixed")
        if frame.parent is None or kind == "free":  # no bone joins a free body to its parent
            continue
        parent = poses[:, number[frame.parent]]
        chain = _through_corner(figure, parent, poses[:, k, :3, 3], kind, frame.name, end)
        bones += [
            {"ends": [a, b], "moves": frame.name in moves, "side": side_of(frame.name)[0]}
            for a, b in itertools.pairwise(chain)
            if a != b and frame.name not in look.without_lines
        ]
    return [bone for bone in _once(bones) if bone["moves"] or look.fixed_lines]


def _joint_words(joint: str) -> str:
    """`right elbow` of `elbow_flexion_r`: what a frame's origin is; "" for joints without a name of their own."""
    side, stem = side_of(joint)
    word = stem.partition("_")[0]
    return f"{side} {word}".strip() if word in NAMED_JOINTS else ""


def _through_corner(
    figure: Figure, parent: Floats, end_place: Floats, kind: str, name: str, end: int
) -> list[int]:
    """A Denavit-Hartenberg row translates along x, then along the joint's z: a spine, then a collar bone."""
    start_place = parent[:, :3, 3]
    start = figure.point(start_place, name)
    if kind not in ("hinge", "slide"):
        return [start, end]
    axis = parent[:, :3, 2]
    along = np.einsum("ti,ti->t", end_place - start_place, axis)
    corner = figure.point(end_place - along[:, None] * axis, f"{name} (corner)")
    return [start, corner, end]


def add_loops(figure: Figure, description: ModelDescription, poses: Floats) -> list[dict[str, Any]]:
    """Adds both points of each closure."""
    number = {frame.name: k for k, frame in enumerate(description.frames)}

    def side(name: str, frame: str, point: Vector) -> int:
        pose = poses[:, number[frame]]
        return figure.point(pose[:, :3, :3] @ np.asarray(point) + pose[:, :3, 3], name)

    loops = []
    for c in description.closures:
        ends = [side(f"{c.name} (a)", c.frame_a, c.point_a), side(f"{c.name} (b)", c.frame_b, c.point_b)]
        loops.append({"name": c.name, "ends": ends, "std_m": c.std_m})
    return loops


def add_strands(figure: Figure, look: Look, rows: Ints) -> list[dict[str, Any]]:
    """Adds the look's strands with their positions as further points."""
    strands = []
    for one in look.strands:
        places = one.places_m[rows]
        points = [figure.point(places[:, k], f"{one.label} {k + 1}") for k in range(places.shape[1])]
        strands.append({"points": points, "radius_m": one.radius_m, "part": one.part, "label": one.label})
    return strands


def carried_shapes(
    figure: Figure, look: Look, frame_names: Sequence[str], poses: Floats
) -> tuple[list[dict[str, Any]], Floats, list[int]]:
    """The look's shapes as plain data, and quat_wxyz (T, 4 K) and points of the K frames that carry them."""
    carriers = list(dict.fromkeys(shape.frame for shape in look.shapes))
    columns, origins = [np.zeros((len(poses), 0))], []
    for name in carriers:
        pose = poses[:, frame_names.index(name)]
        columns.append(continuous_quat(quat_from_matrix(pose[:, :3, :3])))
        origins.append(figure.point(pose[:, :3, 3], name))
    shapes = [
        {
            "carrier": carriers.index(shape.frame),
            "vertices_mm": np.rint(1e3 * shape.vertices_m).astype(int).ravel().tolist(),
            "triangles": shape.triangles.ravel().tolist(),
            "part": shape.part,
            "label": shape.label,
        }
        for shape in look.shapes
    ]
    return shapes, np.concatenate(columns, axis=1), origins


def _same(one: Floats, other: Floats) -> bool:
    with np.errstate(invalid="ignore"):
        apart = np.abs(one - other)
    return bool(
        np.array_equal(np.isnan(one), np.isnan(other)) and np.nanmax(apart, initial=0.0) <= SAME_PLACE_M
    )


def _once(bones: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Two frames at the same position share the bone; it moves if one of them moves."""
    found: dict[tuple[int, int], dict[str, Any]] = {}
    for bone in bones:
        ends = (min(bone["ends"]), max(bone["ends"]))
        known = found.setdefault(ends, bone)
        known["moves"] = known["moves"] or bone["moves"]
        if known["side"] != bone["side"]:
            known["side"] = ""
    return list(found.values())
