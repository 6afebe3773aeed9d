"""Simple shapes (`Look`, `Shape`, `Strand`, `Viewpoint`) from which the viewer draws a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError

Part = Literal["body", "right", "left", "tool", "frame", "seat", "shell"]
"""What a shape belongs to; whoever draws it chooses the colour."""
PARTS: tuple[Part, ...] = ("body", "right", "left", "tool", "frame", "seat", "shell")


@dataclass(frozen=True, eq=False)
class Shape:
    """A solid that a frame carries.

    Args:
        frame: the frame of the model that it moves with.
        vertices_m: (n, 3) m, in that frame's axes.
        triangles: (m, 3) numbers of vertices, anticlockwise seen from outside.
        part: what it belongs to, one of `PARTS`.
        label: what it is, in a word or two.

    Raises:
        DataError: a triangle names a vertex that is not there, or no such part.
    """

    frame: str
    vertices_m: Floats
    triangles: Ints
    part: Part = "body"
    label: str = ""

    def __post_init__(self) -> None:
        vertices = real_array(self.vertices_m, (None, 3), f"shape {self.label}: vertices_m")
        triangles = np.asarray(self.triangles, dtype=np.int64).reshape(-1, 3)
        if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
            raise DataError(f"shape {self.label}: triangles name vertices 0 to {len(vertices) - 1} only")
        if self.part not in PARTS:
            raise DataError(f"shape {self.label}: no part '{self.part}'; there are {', '.join(PARTS)}")
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "triangles", triangles)


@dataclass(frozen=True, eq=False)
class Strand:
    """A rod or chain of rods that is drawn from places over time, because no joint of the model moves it.

    Args:
        places_m: (T, n, 3) m in root axes, on the track's `time_s`; NaN is not drawn.
        radius_m: half its thickness, m.
        part: what it belongs to, one of `PARTS`.
        label: what it is, in a word or two.
    """

    places_m: Floats
    radius_m: float = 0.02
    part: Part = "body"
    label: str = ""


@dataclass(frozen=True)
class Viewpoint:
    """A direction from which to look.

    Args:
        name: on the button.
        seen_from: (3,) root axes, from the figure towards the eye; its length says nothing.
        zoom: 1 fills the picture with all that moves; less shows more around it.
    """

    name: str
    seen_from: tuple[float, float, float]
    zoom: float = 1.0


@dataclass(frozen=True)
class Look:
    """How a track is to be drawn, beyond the lines between its frames.

    Args:
        shapes: solids that frames carry.
        strands: rods drawn from places over time.
        viewpoints: camera presets; none means side, front and above.
        ground_m: height of the plane below the figure along the world's `up`, m; None: below the lowest point.
        ground: what that plane is.
        limb_radius_m: half the thickness of the lines between frames, m; None: by the figure's size.
        without_lines: frames whose line to their parent is not drawn, because a shape shows it.
        fixed_lines: draw lines between frames that never move.
        first_curves: panels that are shown at first: names of joints without `r_` and `l_`, or a curve's `panel`.
        notes: what is drawn and not measured.
        loop_words: what closed loops hold together, for the legend.
    """

    shapes: tuple[Shape, ...] = ()
    strands: tuple[Strand, ...] = ()
    viewpoints: tuple[Viewpoint, ...] = ()
    ground_m: float | None = None
    ground: Literal["ground", "water"] = "ground"
    limb_radius_m: float | None = None
    without_lines: tuple[str, ...] = ()
    fixed_lines: bool = True
    first_curves: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    loop_words: str = "held together"

    def bare(self) -> Look:
        """The same without shapes, strands and notes: for a second figure laid over the first."""
        return replace(self, shapes=(), strands=(), notes=())


def loft(rings: ArrayLike) -> tuple[Floats, Ints]:
    """A closed solid through rings of points: vertices (k n + 2, 3) and triangles.

    Args:
        rings: (k, n, 3), the same number of points in each, anticlockwise seen from the last ring's side. Both ends
            are closed by a fan around their middle.
    """
    around = np.asarray(rings, dtype=np.float64)
    count, size = around.shape[:2]
    vertices = np.concatenate([around.reshape(-1, 3), around[[0, -1]].mean(axis=1)])
    first, last = count * size, count * size + 1
    triangles = []
    for k in range(size):
        after = (k + 1) % size
        for ring in range(count - 1):
            a, b = ring * size + k, ring * size + after
            triangles += [(a, b, a + size), (b, b + size, a + size)]
        triangles.append((first, after, k))
        triangles.append((last, (count - 1) * size + k, (count - 1) * size + after))
    return vertices, np.array(triangles, dtype=np.int64)


def box(center_m: ArrayLike, size_m: ArrayLike) -> tuple[Floats, Ints]:
    """A box along the axes, (3,) m each."""
    half = 0.5 * np.asarray(size_m, dtype=np.float64)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
    rings = [np.column_stack([corners, np.full(4, height)]) * half for height in (-1.0, 1.0)]
    return loft(np.asarray(center_m, dtype=np.float64) + np.stack(rings))


def ellipsoid(center_m: ArrayLike, radii_m: ArrayLike, around: int = 14) -> tuple[Floats, Ints]:
    """An ellipsoid along the axes, (3,) m each, with so many points around."""
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, around // 2 + 1)[1:-1]
    rings = [
        np.column_stack([np.cos(r) * np.cos(turn), np.cos(r) * np.sin(turn), np.full(around, np.sin(r))])
        for r in rise
    ]
    vertices, triangles = loft(rings)
    vertices[-2:] = [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]
    return np.asarray(center_m) + vertices * np.asarray(radii_m), triangles


def tube(points_m: ArrayLike, radii_m: float | Sequence[float], around: int = 10) -> tuple[Floats, Ints]:
    """A round rod through points (k, 3) m, k >= 2, with one radius, or one at each point."""
    points = np.asarray(points_m, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radii_m, dtype=np.float64), len(points))
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # one direction across for all rings, so that the rod does not twist
    across = np.eye(3)[np.argmin(np.abs(along).max(axis=0))]
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    rings = []
    for point, direction, radius in zip(points, along, radii, strict=True):
        side = np.cross(direction, across)
        side /= np.linalg.norm(side)
        rings.append(point + radius * (np.cos(turn) * side + np.sin(turn) * np.cross(direction, side)))
    return loft(rings)
