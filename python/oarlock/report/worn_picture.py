"""The section of a session's page with the units on the body: verdicts, a picture of the still pose, axes in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.static.pose_mounts import rest_posture
from oarlock.recording.calibration import Calibration
from oarlock.recording.unit_names import place_of_name
from oarlock.report.markup import rendered, table
from oarlock.report.pose_picture.skeleton import SkeletonLine, StickFigure, View, skeleton
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

WIDTH, MARGIN, PAD = 430.0, 126.0, 46.0
TALLEST, MOST_PX_PER_M = 520.0, 380.0
AXIS_PX, UNIT_PX, RING_PX = 30.0, 16.0, 4.2
SIDE_M = 0.04
"""A unit so far from the middle is on a side."""
LABEL_PX = 34.0
WIDE_M = 0.8
"""A body this wide, such as one with level arms, has its labels below the arms instead of beside them."""
ALONG_VIEW = 0.5
"""An axis is drawn as a point (toward the reader) or a cross (away) if its arrow would be shorter than this share."""
LIMBS = {
    "trunk": ("pelvis", "lumbar", "thorax", "trunk", "head"),
    "arm": ("shoulder", "upper_arm", "forearm", "hand", "arm"),
    "leg": ("thigh", "shank", "foot", "leg"),
}
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
    "foot": 0.06,
}
OTHER_THICK_M = 0.04
ACROSS_M = 0.1
"""Thickness of a line from the trunk to a shoulder or a hip."""
CENTRAL_PX = 12.0
"""A unit so near to the middle of a picture may have its label on either side."""
STRAIGHT_DEG = 15.0
MARKS = {"good": "✓", "bad": "✗", "unsure": "?"}

Point = tuple[float, float]
Place = Callable[[Floats], Point]


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
    point: Floats
    root_from_sensor: Floats


@dataclass(frozen=True, eq=False)
class WornBody:
    """A body in a still pose, and its units."""

    body: StickFigure
    units: tuple[WornUnit, ...]
    right: Floats

    @classmethod
    def of(
        cls,
        model: Model,
        q: Floats,
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
        aside = float((unit.point - self.body.links[0].start) @ self.right)
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
    """All views as figures beside each other, at one scale where there is room."""
    views = [(view, units, *_bounds(worn, view)) for view, units in worn.panels()]
    scales = [_scale(high - low) for _, _, low, high in views]
    common = min(
        (k for k, (*_, low, high) in zip(scales, views, strict=True) if not _wide(high - low)), default=0.0
    )
    panels = "".join(
        _panel(worn, view, units, (low, high), own if _wide(high - low) else common)
        for own, (view, units, low, high) in zip(scales, views, strict=True)
    )
    return f'<div class="grid-figures worn">{panels}</div>'


def _bounds(worn: WornBody, view: View) -> tuple[Floats, Floats]:
    """Least and largest (right, up) of the body and its units in a view, m."""
    ends = [point for link in worn.body.links for point in (link.start, link.end)]
    flat = np.array([view.project(point) for point in [*ends, *(unit.point for unit in worn.units)]])
    return flat.min(axis=0), flat.max(axis=0)


def _wide(size_m: Floats) -> bool:
    return float(size_m[0]) > WIDE_M


def _scale(size_m: Floats) -> float:
    """Pixels per metre at which a body of this size leaves room for labels."""
    room = WIDTH - 2 * (PAD if _wide(size_m) else MARGIN)
    return float(min(room / max(size_m[0], 0.1), TALLEST / max(size_m[1], 0.1), MOST_PX_PER_M))


def _panel(
    worn: WornBody, view: View, units: Sequence[WornUnit], bounds: tuple[Floats, Floats], scale: float
) -> str:
    low, high = bounds

    def place(point: Floats) -> Point:
        right, up = view.project(point)
        return WIDTH / 2 + scale * (right - 0.5 * (low[0] + high[0])), PAD + scale * (high[1] - up)

    near = np.cross(view.right, view.up)
    limbs = "".join(_limb(links, worn.body.up, place, scale) for links in _limbs(worn, near))
    marks = "".join(_unit(unit, view, near, place) for unit in sorted(units, key=lambda u: u.point @ near))
    top = PAD
    if _wide(high - low):
        # below what reaches into the columns of the labels
        ends = [place(point) for link in worn.body.links for point in (link.start, link.end)]
        aside = [y for x, y in ends if not MARGIN < x < WIDTH - MARGIN]
        top = max(aside, default=0.0) + AXIS_PX + LABEL_PX
    height = 2 * PAD + max(scale * float(high[1] - low[1]), top - PAD + LABEL_PX * (len(units) + 1) / 2.0)
    return (
        f'<figure><figcaption><span class="name">{escape(view.title)}</span></figcaption>'
        f'<svg viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" aria-label="The units on the body, '
        f'{escape(view.title)}">{limbs}{_labels(units, place, top, height)}{marks}</svg></figure>'
    )


def _limbs(worn: WornBody, near: Floats) -> list[list[SkeletonLine]]:
    """Links of the trunk and of each limb, those behind first."""
    limbs: dict[tuple[str, str], list[SkeletonLine]] = {}
    for link in worn.body.links:
        place = place_of_name(link.frame)
        kind = next((kind for kind, names in LIMBS.items() if place.segment in names), "")
        limbs.setdefault((kind, place.side), []).append(link)
    return sorted(limbs.values(), key=lambda links: float(np.mean([(k.start + k.end) @ near for k in links])))


def _limb(links: Sequence[SkeletonLine], up: Floats, place: Place, scale: float) -> str:
    """Thick lines with one outline around them all."""
    lines = []
    for link in links:
        (x1, y1), (x2, y2) = place(link.start), place(link.end)
        segment = place_of_name(link.frame).segment
        thick_m, way = THICK_M.get(segment, OTHER_THICK_M), link.end - link.start
        if segment in LIMBS["trunk"] and abs(float(way @ up)) < 0.7 * float(np.linalg.norm(way)):
            thick_m = ACROSS_M
        lines.append(
            (f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke-width', scale * thick_m)
        )
    edges = "".join(f'<line class="limb-edge" {line}="{thick + 2.5:.1f}"/>' for line, thick in lines)
    return edges + "".join(f'<line class="limb" {line}="{thick:.1f}"/>' for line, thick in lines)


def _unit(unit: WornUnit, view: View, near: Floats, place: Place) -> str:
    """A square in the colour of its verdict, and the three axes of the sensor with their letters."""
    x, y = place(unit.point)
    half, axes = UNIT_PX / 2.0, []
    for axis, letter in zip(unit.root_from_sensor.T, "xyz", strict=True):
        right, up = view.project(axis)
        toward = float(axis @ near)
        axes.append((toward, _axis(letter, (x, y), (right, -up), toward)))
    drawn = "".join(text for _, text in sorted(axes))
    size = f'width="{UNIT_PX:.0f}" height="{UNIT_PX:.0f}" rx="3"'
    square = f'<rect class="worn-unit {unit.style}" x="{x - half:.1f}" y="{y - half:.1f}" {size}/>'
    return f"<g><title>{escape(unit.name)}: {escape(unit.verdict)}</title>{square}{drawn}</g>"


def _axis(letter: str, at: Point, direction: Point, toward: float) -> str:
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
        ring = f'<circle class="worn-ring axis-{letter}" cx="{x:.1f}" cy="{y:.1f}" r="{RING_PX}"/>'
        return ring + inside
    dx, dy = AXIS_PX * direction[0], AXIS_PX * direction[1]
    tx, ty = x + dx, y + dy
    ux, uy = direction[0] / share, direction[1] / share
    back_x, back_y = tx - 5.0 * ux, ty - 5.0 * uy
    head = f"M{back_x - 3 * uy:.1f} {back_y + 3 * ux:.1f}L{tx:.1f} {ty:.1f}L{back_x + 3 * uy:.1f} {back_y - 3 * ux:.1f}"
    return (
        f'<path {style} d="M{x:.1f} {y:.1f}L{tx:.1f} {ty:.1f}{head}"/>'
        f'<text class="worn-letter axis-{letter}" x="{tx + 6 * ux:.1f}" y="{ty + 6 * uy + 3.5:.1f}" '
        f'text-anchor="middle">{letter}</text>'
    )


def _labels(units: Sequence[WornUnit], place: Place, top: float, height: float) -> str:
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
        for unit, y in zip(own, _spread([points[u.name][1] for u in own], top, height), strict=True)
    )


def _spread(wanted: Sequence[float], top: float, height: float) -> list[float]:
    """Heights near the wanted ones, in the same order, that leave room for a label each."""
    found: list[float] = []
    for y in wanted:
        found.append(max(y, found[-1] + LABEL_PX) if found else max(y, top))
    last = height - 0.5 * PAD
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
        f'<text class="worn-name" x="{x:.1f}" y="{y - 2:.1f}" text-anchor="{anchor}">{escape(unit.name)}</text>'
        f'<text class="worn-verdict {unit.style}" x="{x:.1f}" y="{y + 13:.1f}" text-anchor="{anchor}">'
        f"{MARKS[unit.style]} {escape(unit.verdict)}</text>"
    )


def pointing(axis: Floats, body: StickFigure, right: Floats) -> str:
    """Where an axis points in the still pose: "up", or "up, 23 deg forward" if it is more than 15 degrees off."""
    named = {"up": body.up, "down": -body.up, "forward": body.forward, "backward": -body.forward}
    named |= {"right": right, "left": -right}
    order = sorted(named, key=lambda name: -float(named[name] @ axis))
    off_deg = float(np.degrees(np.arccos(np.clip(named[order[0]] @ axis, -1.0, 1.0))))
    return order[0] if off_deg < STRAIGHT_DEG else f"{order[0]}, {off_deg:.0f}° {order[1]}"


Check = Mapping[str, Any]


def worn_section(calibration: Calibration, model: Model, pose: Mapping[str, float] | None = None) -> str:
    """The section as markup.

    Args:
        calibration: of a session.
        model: the body.
        pose: the still pose by coordinate, rad and m; the others are as at rest.
    """
    q = np.asarray(rest_posture(model, dict(pose) if pose else None))
    stds = heading_stds_deg(calibration, model, q)
    noted: Any = calibration.noted["session"]
    verdicts = unit_verdicts(noted["check"], stds)
    worn = WornBody.of(model, q, calibration, verdicts)
    styles = {style: sum(unit.style == style for unit in worn.units) for style in MARKS}
    lead = rendered("session_worn", styles=styles, marks=MARKS)
    rows = [_row(unit, worn, stds) for unit in worn.units]
    heads = ["unit", "result", "x points", "y points", "z points", "heading std, deg"]
    listed = table("worn-axes", "Axes of each sensor in the still pose, seen from the person.", heads, rows)
    return f'{lead}{worn_picture(worn)}<div class="compared">{listed}</div>'


def heading_stds_deg(calibration: Calibration, model: Model, q: Floats) -> dict[str, float]:
    """Unit -> standard deviation of its mount about the vertical in a posture, deg."""
    poses, up = np.asarray(model.forward_kinematics(q)), np.asarray(model.describe().world.up)
    found = {}
    for sensor in model.describe().inertial_units:
        std_rad = calibration.mount_stds_rad.get(sensor.name)
        if std_rad is not None:
            in_link = poses[model.frame_names.index(sensor.frame), :3, :3].T @ up
            found[sensor.name] = float(np.degrees(np.linalg.norm(in_link * np.asarray(std_rad))))
    return found


def unit_verdicts(checks: Sequence[Check], heading_deg: Mapping[str, float]) -> dict[str, tuple[str, str]]:
    """Unit -> (style, words). A mount that is unsure mostly about the vertical is an uncertain heading."""
    found = {}
    for mount in (check for check in checks if check["what"] == "mount"):
        name, std = mount["subject"], mount.get("std", float("nan"))
        failed = [c for c in checks if c["subject"] == name and c["outcome"] == "redo"]
        heading = heading_deg.get(name, 0.0)
        if not failed:
            found[name] = ("good", f"± {std:.1f}°")
        elif all(check is mount for check in failed) and heading >= HEADING_SHARE * std:
            found[name] = ("unsure", f"heading ± {heading:.0f}°")
        else:
            what = "mount" if any(check is mount for check in failed) else failed[0]["what"]
            found[name] = ("bad", f"± {std:.0f}°" if what == "mount" else str(what))
    return found


HEADING_SHARE = 0.8


def _row(unit: WornUnit, worn: WornBody, stds: Mapping[str, float]) -> list[str]:
    style = "open" if unit.style == "unsure" else unit.style
    verdict = f'<span class="verdict {style}">{MARKS[unit.style]} {escape(unit.verdict)}</span>'
    axes = [escape(pointing(axis, worn.body, worn.right)) for axis in unit.root_from_sensor.T]
    return [escape(unit.name), verdict, *axes, f"{stds[unit.name]:.1f}" if unit.name in stds else "–"]
