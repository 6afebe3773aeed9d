"""A posture as an SVG document."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.sax.saxutils import escape

from oarlock.report.pose_picture.skeleton import Bounds, SkeletonLine, Spot, StickFigure, View, views
from oarlock.storage.arrays import Floats

Point = tuple[float, float]
Box = tuple[float, float, float, float]

_LETTER_PX = 6.0
_SAME_PLACE_PX = 3.0
# a label over a mark or another label costs more than one over a line
_MARK_WEIGHT = 4
_TEXT_WEIGHT = 100
_PANEL_PX = 420.0
_PAD_PX = 70.0
_HEAD_PX = 56.0


def draw_svg(body: StickFigure, title: str) -> str:
    """The two views as one SVG document on white, with the names of all frames that fit."""
    pair = views(body)
    boxes = [view.bounds(body) for view in pair]
    px_per_m = _PANEL_PX / max(max(box.width, box.height, 0.1) for box in boxes)
    widths = [box.width * px_per_m + 2 * _PAD_PX for box in boxes]
    height = max(box.height for box in boxes) * px_per_m + 1.5 * _PAD_PX + _HEAD_PX
    left, panels = 0.0, []
    for view, box, width in zip(pair, boxes, widths, strict=True):
        panels.append(_svg_panel(body, view, box, px_per_m, left, width))
        left += width
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left:.0f} {height:.0f}" '
        f'width="{left:.0f}" height="{height:.0f}" font-family="system-ui, sans-serif" font-size="11">\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n'
        f'<text x="16" y="26" font-size="15" font-weight="600" fill="#1d2733">{escape(title)}</text>\n'
        + "\n".join(panels)
        + "\n</svg>\n"
    )


def _svg_panel(body: StickFigure, view: View, box: Bounds, px_per_m: float, left: float, width: float) -> str:
    def place(point: Floats) -> Point:
        right, up = view.project(point)
        return (
            left + _PAD_PX + (right - box.left) * px_per_m,
            _HEAD_PX + _PAD_PX / 2 + (box.top - up) * px_per_m,
        )

    parts = [
        f'<text x="{left + width / 2:.1f}" y="{_HEAD_PX:.0f}" text-anchor="middle" '
        f'fill="#5a6878">{view.title}</text>'
    ]
    parts += [_svg_line(place(link.start), place(link.end), _link_style(link)) for link in body.links]
    gap_style = 'stroke="#c0392b" stroke-width="1.5" stroke-dasharray="3 4"'
    parts += [_svg_line(place(a), place(b), gap_style) for a, b in body.gaps]
    points = [place(spot.point) for spot in body.spots]
    for has_sensor in (False, True):
        parts += [
            _svg_mark(at, has_sensor)
            for spot, at in zip(body.spots, points, strict=True)
            if spot.has_sensor is has_sensor
        ]
    lines = [(place(link.start), place(link.end)) for link in body.links]
    lines += [(place(a), place(b)) for a, b in body.gaps]
    parts += _svg_names(body.spots, points, lines, left + width / 2)
    return "\n".join(parts)


def _link_style(link: SkeletonLine) -> str:
    if link.moves:
        return 'stroke="#33475b" stroke-width="5" stroke-linecap="round"'
    return 'stroke="#b5c0cb" stroke-width="1.5"'


def _svg_line(start: Point, end: Point, style: str) -> str:
    return f'<line x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}" {style}/>'


def _svg_mark(at: Point, has_sensor: bool) -> str:
    if has_sensor:
        return (
            f'<rect x="{at[0] - 5:.1f}" y="{at[1] - 5:.1f}" width="10" height="10" rx="2" '
            'fill="#e67e22" stroke="#ffffff"/>'
        )
    return (
        f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="4" fill="#ffffff" stroke="#33475b" stroke-width="2"/>'
    )


def _svg_names(
    spots: Sequence[Spot], points: Sequence[Point], lines: Sequence[tuple[Point, Point]], middle: float
) -> list[str]:
    """The names, each where it covers least of the drawing."""
    drawn = [at for line in lines for at in _along(*line)] + [
        at for at in points for _ in range(_MARK_WEIGHT)
    ]
    written: list[Box] = []
    named: list[Point] = []
    parts = []
    for spot, (x, y) in zip(spots, points, strict=True):
        # of frames at the same place in the view only the first is named
        if any(math.dist((x, y), at) < _SAME_PLACE_PX for at in named):
            continue
        named.append((x, y))
        length = _LETTER_PX * len(spot.name)
        right, left, centre = x + 9, x - 9 - length, x - length / 2
        outward = (right, left) if x >= middle else (left, right)
        places = [(low, base) for base in (y + 4, y + 18, y - 9, y + 32, y - 23) for low in outward]
        places += [(centre, y + 20), (centre, y - 12), (centre, y + 34)]
        boxes = [(low - 2, base - 12, low + length + 2, base + 3) for low, base in places]
        costs = [
            sum(_inside(at, box) for at in drawn)
            + _TEXT_WEIGHT * sum(_overlap(box, other) for other in written)
            for box in boxes
        ]
        best = costs.index(min(costs))
        written.append(boxes[best])
        low, top, high, bottom = boxes[best]
        parts.append(
            f'<rect x="{low:.1f}" y="{top:.1f}" width="{high - low:.1f}" height="{bottom - top:.1f}" '
            'rx="2" fill="#ffffff" fill-opacity="0.8"/>'
            f'<text x="{places[best][0]:.1f}" y="{places[best][1]:.1f}" textLength="{length:.1f}" '
            f'lengthAdjust="spacingAndGlyphs" fill="#1d2733">{escape(spot.name)}</text>'
        )
    return parts


def _along(start: Point, end: Point) -> list[Point]:
    steps = max(1, math.ceil(math.dist(start, end) / 4.0))
    shares = [k / steps for k in range(steps + 1)]
    return [(start[0] + s * (end[0] - start[0]), start[1] + s * (end[1] - start[1])) for s in shares]


def _inside(at: Point, box: Box) -> bool:
    return box[0] <= at[0] <= box[2] and box[1] <= at[1] <= box[3]


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
