"""The figure of the live page: its structure once, then positions of its points for each estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.model.shapes import Look, Strand
from oarlock.report.viewer.figure import SAME_PLACE_M, Figure, add_frames, add_loops, carried_shapes
from oarlock.report.viewer.scene import viewpoints_of
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

Strands = Callable[[Floats], Sequence[Strand]]
"""Coordinates (T, n) -> strands."""
_POSTURES = 5
"""Random postures that tell which points move, and with which link."""
_WIDE = 0.5
_MM = 1e3


@dataclass(frozen=True, eq=False)
class LivePicture:
    """The figure of a model.

    Args:
        model: the body.
        structure: what a page needs once: points, bones, loops, shapes, viewpoints.
        carriers: frames that carry the moving points (P,), by number.
        offsets_m: (P, 3) of the moving points in the axes of their frames.
        shape_frames: frames that carry shapes, by number.
        strands: what is drawn between frames, from coordinates; None for nothing.
    """

    model: Model
    structure: dict[str, Any]
    carriers: Ints
    offsets_m: Floats
    shape_frames: Ints
    strands: Strands | None = None

    @classmethod
    def of(cls, model: Model, look: Look | None = None, strands: Strands | None = None) -> LivePicture:
        """The figure of a model with the shapes and strands of its field of application."""
        seen = Look() if look is None else look
        description = model.describe()
        rng = np.random.default_rng(0)
        q = rng.uniform(-_WIDE, _WIDE, (_POSTURES, len(model.coordinate_names)))
        poses = np.asarray(model.forward_kinematics(q))
        figure = Figure()
        bones = add_frames(figure, description, poses, seen)
        loops = add_loops(figure, description, poses)
        shapes, _, origins = carried_shapes(figure, seen, list(model.frame_names), poses)
        points, _ = figure.described()
        moving = [place for place, point in zip(figure.places, points, strict=True) if point["still"] is None]
        held = [_carried(place, poses) for place in moving]
        lines = [] if strands is None else strands(np.zeros((1, q.shape[1])))
        structure = {
            "model": model.name,
            "world": {"up": list(description.world.up), "forward": list(description.world.forward)},
            "ground": {"kind": seen.ground, "height_m": seen.ground_m},
            "viewpoints": viewpoints_of(seen, description.world),
            "limb_radius_m": seen.limb_radius_m,
            "points": [*points, *_points_of(lines)],
            "bones": bones,
            "loops": loops,
            "strands": _described(lines, len(points)),
            "shapes": shapes,
            "carriers": {"points": origins},
            "first_curves": [name.replace("_", " ") for name in seen.first_curves],
        }
        names = list(model.frame_names)
        frames = [names.index(name) for name in dict.fromkeys(shape.frame for shape in seen.shapes)]
        return cls(
            model,
            structure,
            np.array([frame for frame, _ in held], dtype=np.int64),
            np.array([offset for _, offset in held]).reshape(-1, 3),
            np.array(frames, dtype=np.int64),
            strands,
        )

    def frame(self, q: Floats) -> dict[str, Any]:
        """Positions of the moving points, mm, and turns of the shapes' frames, as rows of numbers.

        Args:
            q: (n,) coordinates; one that is not known is taken as 0.
        """
        poses = np.asarray(self.model.forward_kinematics(np.nan_to_num(q)[None]))[0]
        held = poses[self.carriers]
        places = np.einsum("pij,pj->pi", held[:, :3, :3], self.offsets_m) + held[:, :3, 3]
        if self.strands is not None:
            lines = self.strands(np.nan_to_num(q)[None])
            places = np.concatenate([places, *(line.places_m[0] for line in lines)])
        turned = poses[self.shape_frames, :3, :3]
        return {
            "places_mm": np.rint(_MM * places).astype(int).ravel().tolist(),
            "turns": np.round(turned, 4).ravel().tolist(),
        }


def _points_of(lines: Sequence[Strand]) -> list[dict[str, Any]]:
    names = [f"{line.label} {k + 1}" for line in lines for k in range(line.places_m.shape[1])]
    return [{"name": name, "frames": [], "side": "", "still": None} for name in names]


def _described(lines: Sequence[Strand], first: int) -> list[dict[str, Any]]:
    """The strands as plain data; their points stand behind the figure's, from number `first` on."""
    found = []
    for line in lines:
        count = line.places_m.shape[1]
        numbers = list(range(first, first + count))
        found.append({"points": numbers, "radius_m": line.radius_m, "part": line.part, "label": line.label})
        first += count
    return found


def _carried(place: Floats, poses: Floats) -> tuple[int, Floats]:
    """The frame in whose axes a point stays, and where."""
    for frame in range(poses.shape[1]):
        pose = poses[:, frame]
        own = np.einsum("tji,tj->ti", pose[:, :3, :3], place - pose[:, :3, 3])
        if np.ptp(own, axis=0).max() < SAME_PLACE_M:
            return frame, own[0]
    raise DataError("a point of the figure moves with none of the model's frames")
