"""The moving figure of the home page: a stroke of an estimated sculler as an SVG that needs no script."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

import oarlock
from oarlock import rowing
from oarlock.storage.arrays import Floats, Ints

FRAMES = 40
STROKE_S = 2.5
BEGIN_S = 4.0
MARGIN_M = 0.1
SCALE = 230.0
"""Pixels a metre."""
TO_PICTURE = np.array([[0.30, 0.16], [0.0, 1.0], [1.0, 0.0]])
"""From root axes (left, up, along the boat) to the picture: seen from the side, a little from behind and above."""
COLOURS = {"body": "#7a8ca3", "right": "#c0392b", "left": "#2e7d5b", "tool": "#666", "seat": "#8a6d3b"}
STYLE = """<style>
g{{visibility:hidden;animation:show {cycle}s steps(1) infinite}}
@keyframes show{{0%{{visibility:visible}}{share:.4f}%{{visibility:hidden}}}}
@media (prefers-reduced-motion:reduce){{g{{animation:none}}g:first-of-type{{visibility:visible}}}}
</style>"""


def write_picture(file: Path) -> None:
    """Simulate, track and smooth some strokes, and draw one of them."""
    model = oarlock.load_model("sculler")
    _, recording = oarlock.simulate(model, rowing.sculling(model, duration_s=BEGIN_S + 2 * STROKE_S), seed=1)
    track = oarlock.smooth(oarlock.track(model, recording))
    rows = np.searchsorted(track.time_s, BEGIN_S + STROKE_S * np.arange(FRAMES) / FRAMES)
    figure = list(_outlines(track, rows))
    # The hull is longer than the picture.
    corners = np.concatenate(
        [corners_of_frame for part, frames in figure if part != "shell" for corners_of_frame in frames]
    )
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    size = (high - low) * SCALE
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]:.0f} {size[1]:.0f}">',
        "<title>A sculler over one stroke</title>",
        STYLE.format(cycle=STROKE_S, share=100 / FRAMES),
    ]
    for frame in range(FRAMES):
        lines.append(f'<g style="animation-delay:{frame * STROKE_S / FRAMES - STROKE_S:.3f}s">')
        for part, frames in figure:
            places = np.round((frames[frame] - low) * SCALE)
            places[:, 1] = np.round(size[1]) - places[:, 1]
            points = " ".join(f"{x:.0f},{y:.0f}" for x, y in places)
            lines.append(f'<polygon fill="{COLOURS.get(part, "#888")}" opacity=".85" points="{points}"/>')
        lines.append("</g>")
    file.write_text("\n".join([*lines, "</svg>"]), encoding="utf-8")


def _outlines(track: oarlock.Track, rows: Ints) -> Iterator[tuple[str, list[Floats]]]:
    """Each part of the body with its outline in the picture at each row."""
    drawing = rowing.rowing_look(track)
    assert drawing is not None
    shapes = [candidate for candidate in drawing.shapes if candidate.part != "frame"]
    for shape in sorted(shapes, key=lambda candidate: candidate.part != "shell"):
        if shape.frame == "root":
            corners = np.broadcast_to(shape.vertices_m, (len(rows), *shape.vertices_m.shape))
        else:
            rotated = _matrices(track.frame_quat_wxyz(shape.frame)[rows]) @ shape.vertices_m.T
            corners = rotated.transpose(0, 2, 1) + track.frame_positions(shape.frame)[rows][:, None]
        yield shape.part, [_hull(candidate @ TO_PICTURE) for candidate in corners]
    for strand in drawing.strands:
        for begin in range(strand.places_m.shape[1] - 1):
            ends = strand.places_m[rows, begin : begin + 2]
            yield strand.part, [_rod(candidate @ TO_PICTURE, strand.radius_m) for candidate in ends]
    for side in ("r", "l"):
        chain = [f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"]
        places = np.stack([track.frame_positions(candidate)[rows] for candidate in chain], axis=1)
        for begin in (0, 1):
            yield "body", [_rod(candidate @ TO_PICTURE, 0.04) for candidate in places[:, begin : begin + 2]]


def _matrices(quat_wxyz: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quat_wxyz[:, [1, 2, 3, 0]]).as_matrix())


def _hull(places: Floats) -> Floats:
    return np.asarray(places[ConvexHull(places).vertices])


def _rod(ends: Floats, radius: float) -> Floats:
    """A rod between two places as an outline with round ends."""
    turns = np.linspace(0, 2 * np.pi, 9)[:-1]
    circle = radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return _hull(np.concatenate([ends[0] + circle, ends[1] + circle]))
