"""The lines and points of a posture, and the view directions, for the pictures of `oarlock model show`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from oarlock.model.description import FrameDescription
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model


# points closer than this count as one
SAME_POINT_M = 1e-6


@dataclass(frozen=True)
class SkeletonLine:
    """A line on a frame between two points in root axes, m; `moves` is false if it is fixed to the root."""

    start: Floats
    end: Floats
    moves: bool
    frame: str


@dataclass(frozen=True)
class Spot:
    """A named point in root axes, m; `has_sensor` if a sensor is mounted on its frame."""

    name: str
    point: Floats
    has_sensor: bool


@dataclass(frozen=True)
class StickFigure:
    """The content of a picture in root axes, m; `gaps` join the two points of each closure."""

    links: tuple[SkeletonLine, ...]
    spots: tuple[Spot, ...]
    gaps: tuple[tuple[Floats, Floats], ...]
    up: Floats
    forward: Floats


@dataclass(frozen=True)
class View:
    """A projection: which root axes point right and up in the picture."""

    title: str
    right: Floats
    up: Floats

    def project(self, point: Floats) -> tuple[float, float]:
        """Point in root axes to (right, up), m."""
        return float(point @ self.right), float(point @ self.up)

    def bounds(self, body: StickFigure) -> Bounds:
        """The smallest box, sides along right and up, that contains every spot."""
        flat = np.array([self.project(spot.point) for spot in body.spots])
        left, bottom = (float(value) for value in flat.min(axis=0))
        right, top = (float(value) for value in flat.max(axis=0))
        return Bounds(left, bottom, right, top)


@dataclass(frozen=True)
class Bounds:
    """A box in a view, m."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """Right minus left, m."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Top minus bottom, m."""
        return self.top - self.bottom


def views(body: StickFigure) -> tuple[View, View]:
    """Side view and front view of a body."""
    left = _unit(np.cross(body.up, body.forward))
    return View("from its right side", body.forward, body.up), View("from the front", left, body.up)


def skeleton(model: Model, q: ArrayLike) -> StickFigure:
    """The lines and points of a model's posture.

    Args:
        model: the model.
        q: values of the coordinates (n_coordinates,), rad or m.

    Raises:
        ValueError: q has the wrong shape.
    """
    description = model.describe()
    frames = description.frames
    poses = np.asarray(model.forward_kinematics(np.asarray(q, dtype=np.float64)), dtype=np.float64)
    place = {frame.name: pose for frame, pose in zip(frames, poses, strict=True)}
    moving: set[str] = set()
    for frame in frames:
        if frame.joint is not None or frame.parent in moving:
            moving.add(frame.name)
    kinds = {joint.name: joint.kind for joint in description.joints}
    links = [
        link
        for frame in frames
        for link in _links(frame, place, frame.name in moving, kinds.get(frame.joint or "", "fixed"))
    ]
    return StickFigure(
        links=tuple(links),
        spots=_spots(frames, place, {sensor.frame for sensor in description.sensors}),
        gaps=tuple(
            (_at(place[c.frame_a], c.point_a), _at(place[c.frame_b], c.point_b)) for c in description.closures
        ),
        up=_unit(description.world.up),
        forward=_unit(description.world.forward),
    )


def _links(
    frame: FrameDescription, place: Mapping[str, Floats], moves: bool, kind: str
) -> list[SkeletonLine]:
    # no line joins a free body to its parent
    if frame.parent is None or kind == "free":
        return []
    parent, child = place[frame.parent], place[frame.name]
    start, end = parent[:3, 3], child[:3, 3]
    # a Denavit-Hartenberg row translates along x, then along the joint's z: a spine, then a collar bone
    corner = end - float((end - start) @ parent[:3, 2]) * parent[:3, 2]
    ends = (start, corner, end) if kind in ("hinge", "slide") else (start, end)
    return [
        SkeletonLine(a, b, moves, frame.parent)
        for a, b in pairwise(ends)
        if float(np.linalg.norm(b - a)) > SAME_POINT_M
    ]


def _spots(
    frames: Sequence[FrameDescription], place: Mapping[str, Floats], with_sensor: set[str | None]
) -> tuple[Spot, ...]:
    spots: list[Spot] = []
    for frame in frames:
        point = place[frame.name][:3, 3]
        here = [k for k, spot in enumerate(spots) if np.linalg.norm(spot.point - point) <= SAME_POINT_M]
        if here:
            # frames at the same point have the name of the first
            first = spots[here[0]]
            spots[here[0]] = Spot(first.name, first.point, first.has_sensor or frame.name in with_sensor)
        else:
            spots.append(Spot(frame.name, point, frame.name in with_sensor))
    return tuple(spots)


def _at(pose: Floats, point: ArrayLike) -> Floats:
    return np.asarray(pose[:3, :3] @ np.asarray(point) + pose[:3, 3])


def _unit(direction: ArrayLike) -> Floats:
    vector = np.asarray(direction, dtype=np.float64)
    unit: Floats = vector / float(np.linalg.norm(vector))
    return unit
