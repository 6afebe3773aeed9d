"""A picture of a body in a still pose with its units: where each sits and which way its axes point. For session pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from oarlock.recording.unit_names import place_of_name
from oarlock.report.pose_picture.skeleton import Link, Skeleton, Vector, View, skeleton

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

WIDTH, MARGIN, TOP, BOTTOM = 380.0, 104.0, 30.0, 22.0
TALLEST, MOST_PX_PER_M = 500.0, 420.0
AXIS_M = 0.13
SIDE_M = 0.04
"""A unit so far from the middle is on a side."""
LABEL_PX = 31.0
ALONG_VIEW = 0.5
"""An axis is drawn as a point (toward the reader) or a cross (away) if its arrow would be shorter than this share."""
THICK_M = {
    "pelvis": 0.2,
    "lumbar": 0.2,
    "thorax": 0.2,
    "trunk": 0.2,
    "head": 0.15,
    "upper_arm": 0.085,
    "forearm": 0.07,
    "hand": 0.055,
    "thigh": 0.14,
    "shank": 0.1,
    "foot": 0.075,
}
OTHER_THICK_M = 0.04
CENTRAL_PX = 12.0
"""A unit so near to the middle of a picture may have its label on either side."""
STRAIGHT_DEG = 15.0
MARKS = {"good": "✓", "bad": "✗", "unsure": "?"}

Point = tuple[float, float]
Place = Callable[[Vector], Point]


@dataclass(frozen=True, eq=False)
class WornUnit:
    """A unit on the body.

    Args:
        name: of the unit.
        style: `good`, `bad` or `unsure`.
        verdict: one or two words.
        point: (3,) m, root axes.
        root_from_sensor: (3, 3).
    """

    name: str
    style: str
    verdict: str
    point: Vector
    root_from_sensor: Vector


@dataclass(frozen=True, eq=False)
class WornBody:
    """A body in a still pose, and its units."""

    body: Skeleton
    units: tuple[WornUnit, ...]
    right: Vector

    @classmethod
    def of(
        cls,
        model: Model,
        q: Vector,
        calibration: Calibration,
        verdicts: Mapping[str, tuple[str, str]],
    ) -> WornBody:
        """The body at coordinates `q`; unit -> (style, verdict) of those that are drawn."""
        drawn = skeleton(model, q)
        poses = np.asarray(model.forward_kinematics(q))
        units = []
        for sensor in model.describe().inertial_units:
            if sensor.name in verdicts and sensor.name in calibration.mounts:
                pose = poses[model.frame_names.index(sensor.frame)]
                turn, offset = calibration.mounts[sensor.name]
                point = pose[:3, :3] @ np.asarray(offset) + pose[:3, 3]
                units.append(WornUnit(sensor.name, *verdicts[sensor.name], point, pose[:3, :3] @ turn))
        return cls(drawn, tuple(units), np.cross(drawn.forward, drawn.up))

    def side(self, unit: WornUnit) -> int:
        """1 on the person's right, -1 on the left, 0 in the middle."""
        middle = np.mean([0.5 * (link.start + link.end) for link in self.body.links], axis=0)
        aside = float((unit.point - middle) @ self.right)
        return 0 if abs(aside) < SIDE_M else int(np.sign(aside))

    def panels(self) -> list[tuple[View, list[WornUnit]]]:
        """Views with the units that are seen in them: from the right, from the front, from the left."""
        sides = {side: [u for u in self.units if self.side(u) == side] for side in (1, 0, -1)}
        forward, up = self.body.forward, self.body.up
        from_right = (View("from the right", forward, up), [*sides[0], *sides[1]])
        from_left = (View("from the left", -forward, up), sides[-1] if sides[1] else [*sides[0], *sides[-1]])
        front = (View("from the front", -self.right, up), list(self.units))
        first = [from_right] if sides[1] or not sides[-1] else []
        return [*first, front, *([from_left] if sides[-1] else [])]


def worn_picture(worn: WornBody) -> str:
    """All views as figures beside each other."""
    panels = "".join(_panel(worn, view, units) for view, units in worn.panels())
    return f'<div class="grid-figures worn">{panels}</div>'


def _panel(worn: WornBody, view: View, units: Sequence[WornUnit]) -> str:
    ends = np.array([p for link in worn.body.links for p in (link.start, link.end)])
    across, high = ends @ view.right, ends @ view.up
    room = WIDTH - 2 * MARGIN
    scale = min(TALLEST / max(np.ptp(high), 0.1), room / max(np.ptp(across), 0.1), MOST_PX_PER_M)
    middle, top = 0.5 * (across.min() + across.max()), high.max()
    height = TOP + max(scale * float(np.ptp(high)), LABEL_PX * len(units) / 2.0 + 20.0) + BOTTOM

    def place(point: Vector) -> Point:
        right, up = view.project(point)
        return WIDTH / 2 + scale * (right - middle), TOP + scale * (top - up)

    near = np.cross(view.right, view.up)
    links = sorted(worn.body.links, key=lambda link: float((link.start + link.end) @ near))
    limbs = "".join(_limb(link, place, scale) for link in links)
    marks = "".join(
        _unit(unit, view, near, place, scale) for unit in sorted(units, key=lambda u: u.point @ near)
    )
    labels = _labels(units, place, height)
    return (
        f'<figure><figcaption><span class="name">{escape(view.title)}</span></figcaption>'
        f'<svg viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" aria-label="The units on the body, '
        f'{escape(view.title)}">{limbs}{labels}{marks}</svg></figure>'
    )


def _limb(link: Link, place: Place, scale: float) -> str:
    (x1, y1), (x2, y2) = place(link.start), place(link.end)
    thick = scale * THICK_M.get(place_of_name(link.frame).segment, OTHER_THICK_M)
    line = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke-width'
    return f'<line class="limb-edge" {line}="{thick + 2.0:.1f}"/><line class="limb" {line}="{thick:.1f}"/>'


def _unit(unit: WornUnit, view: View, near: Vector, place: Place, scale: float) -> str:
    """A square in the colour of its verdict, and the three axes of the sensor with their letters."""
    x, y = place(unit.point)
    axes = []
    for axis, letter in zip(unit.root_from_sensor.T, "xyz", strict=True):
        right, up = view.project(axis)
        toward = float(axis @ near)
        axes.append((toward, _axis(letter, (x, y), (right, -up), toward, AXIS_M * scale)))
    drawn = "".join(text for _, text in sorted(axes))
    square = f'<rect class="worn-unit {unit.style}" x="{x - 6:.1f}" y="{y - 6:.1f}" width="12" height="12" rx="2.5"/>'
    return f"<g><title>{escape(unit.name)}: {escape(unit.verdict)}</title>{square}{drawn}</g>"


def _axis(letter: str, at: Point, direction: Point, toward: float, length: float) -> str:
    """An arrow; a ring with a point if the axis points to the reader, with a cross if it points away."""
    x, y = at
    share = float(np.hypot(*direction))
    style = f'class="worn-axis axis-{letter}"'
    if share < ALONG_VIEW:
        inside = (
            f'<circle class="worn-dot axis-{letter}" cx="{x:.1f}" cy="{y:.1f}" r="1.8"/>'
            if toward > 0.0
            else f'<path {style} d="M{x - 3:.1f} {y - 3:.1f}l6 6m0 -6l-6 6"/>'
        )
        ring = f'<circle class="worn-ring axis-{letter}" cx="{x:.1f}" cy="{y:.1f}" r="4.6"/>'
        return ring + inside
    dx, dy = length * direction[0], length * direction[1]
    tx, ty = x + dx, y + dy
    ux, uy = direction[0] / share, direction[1] / share
    back_x, back_y = tx - 5.0 * ux, ty - 5.0 * uy
    head = f"M{back_x - 3 * uy:.1f} {back_y + 3 * ux:.1f}L{tx:.1f} {ty:.1f}L{back_x + 3 * uy:.1f} {back_y - 3 * ux:.1f}"
    return (
        f'<path {style} d="M{x:.1f} {y:.1f}L{tx:.1f} {ty:.1f}{head}"/>'
        f'<text class="worn-letter axis-{letter}" x="{tx + 6 * ux:.1f}" y="{ty + 6 * uy + 3.5:.1f}" '
        f'text-anchor="middle">{letter}</text>'
    )


def _labels(units: Sequence[WornUnit], place: Place, height: float) -> str:
    """Names and verdicts in two columns beside the body, each joined to its unit by a line."""
    points = {unit.name: place(unit.point) for unit in units}
    columns: tuple[list[WornUnit], list[WornUnit]] = ([], [])
    for unit in sorted(units, key=lambda u: points[u.name][1]):
        aside = points[unit.name][0] - WIDTH / 2
        free = len(columns[0]) > len(columns[1])
        columns[int(free if abs(aside) < CENTRAL_PX else aside > 0.0)].append(unit)
    return "".join(
        _label(unit, points[unit.name], y, column == 1)
        for column, own in enumerate(columns)
        for unit, y in zip(own, _spread([points[u.name][1] for u in own], height), strict=True)
    )


def _spread(wanted: Sequence[float], height: float) -> list[float]:
    """Heights near the wanted ones, in the same order, that leave room for a label each."""
    found: list[float] = []
    for y in wanted:
        found.append(max(y, found[-1] + LABEL_PX) if found else max(y, TOP))
    last = height - BOTTOM
    for k in range(len(found) - 1, -1, -1):
        found[k] = min(found[k], last)
        last = found[k] - LABEL_PX
    return found


def _label(unit: WornUnit, at: Point, y: float, on_the_right: bool) -> str:
    edge = WIDTH - MARGIN + 12.0 if on_the_right else MARGIN - 12.0
    anchor = "start" if on_the_right else "end"
    x = edge + (4.0 if on_the_right else -4.0)
    return (
        f'<path class="worn-leader" d="M{edge:.1f} {y:.1f}L{at[0]:.1f} {at[1]:.1f}"/>'
        f'<text class="worn-name" x="{x:.1f}" y="{y - 1:.1f}" text-anchor="{anchor}">{escape(unit.name)}</text>'
        f'<text class="worn-verdict {unit.style}" x="{x:.1f}" y="{y + 12:.1f}" text-anchor="{anchor}">'
        f"{MARKS[unit.style]} {escape(unit.verdict)}</text>"
    )


def pointing(axis: Vector, body: Skeleton, right: Vector) -> str:
    """Where an axis points in the still pose: "up", or "up, 23 deg forward" if it is more than 15 degrees off."""
    named = {"up": body.up, "down": -body.up, "forward": body.forward, "backward": -body.forward}
    named |= {"right": right, "left": -right}
    order = sorted(named, key=lambda name: -float(named[name] @ axis))
    off_deg = float(np.degrees(np.arccos(np.clip(named[order[0]] @ axis, -1.0, 1.0))))
    return order[0] if off_deg < STRAIGHT_DEG else f"{order[0]}, {off_deg:.0f}° {order[1]}"
