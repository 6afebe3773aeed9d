"""Shapes of oars, blades, hull and riggers, and of an ergometer's frame, for the viewer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.model import Shape
from oarlock.model.shapes import Part, box, loft, tube
from oarlock.rowing.figure.rower import RowerFigure
from oarlock.storage.arrays import Floats, Ints

_SCULL_M, _SWEEP_OAR_M = 2.88, 3.72
_HANDLE_END_M, _SWEEP_HANDLE_END_M = 0.065, 0.15
"""From the grip's centre to the handle's end."""
_BLADE_M, _BLADE_HALF_HEIGHT_M = 0.46, 0.11
_HULL_HALF_LENGTH_M = 4.1
_HULL_HALF_WIDTH_M = 0.145
_HULL_DEPTH_M = 0.17
_DECK_ABOVE_WATER_M = 0.12


@dataclass(frozen=True)
class SceneShapes:
    """Shapes around the rower, and the height of the plane beneath, m."""

    shapes: tuple[Shape, ...]
    ground_m: float


def boat_shapes(rower: RowerFigure) -> SceneShapes:
    """Oars with blades, riggers, hull, seat and stretcher; the water lies just beneath the blades of the recovery."""
    oars, tips = [], []
    for handle, oarlock, part in _oars(rower):
        solid, tip = _oar(rower, handle, oarlock)
        oars += [rower.carried(handle, *piece, f"{part or 'the'} oar") for piece in _coloured(solid, part)]
        pose, rest = rower.over_time(handle), rower.upright[rower.names.index(handle)]
        tips.append((pose[:, :3, :3] @ (rest[:3, :3].T @ (tip - rest[:3, 3])) + pose[:, :3, 3])[:, 1])
    highest = float(np.nanpercentile(np.concatenate(tips), 90.0))
    level = rower.standing(rower.boat)[1]
    water = float(np.clip(highest - _BLADE_HALF_HEIGHT_M - 0.015, level - 0.32, level - 0.02))
    shapes = (*oars, *rower.seat_and_stretcher(), *_hull(rower, water), *_riggers(rower, water))
    return SceneShapes(shapes, water)


def machine_shapes(rower: RowerFigure) -> SceneShapes:
    """Rail, legs and flywheel of an ergometer, seat, stretcher, chain and handle."""
    floor = rower.toe_m[1] - 0.26
    front = rower.toe_m[2] + 0.42
    rail = rower.standing("seat")[1] - 0.16
    wheel = _disc(np.array([0.0, rail + 0.14, front + 0.08]), 0.27, 0.09)
    shapes = [
        rower.carried(
            "root", box([0.0, rail, 0.5 * front - 0.35], [0.07, 0.06, front + 0.9]), "frame", "rail"
        ),
        rower.carried(
            "root", box([0.0, 0.5 * (rail + floor), -0.72], [0.42, rail - floor, 0.05]), "frame", "leg"
        ),
        rower.carried(
            "root", box([0.0, 0.5 * (rail + floor), front], [0.42, rail - floor, 0.05]), "frame", "leg"
        ),
        rower.carried("root", wheel, "frame", "flywheel"),
        *rower.seat_and_stretcher(),
    ]
    if {"r_handle", "l_handle", "bar"} <= set(rower.names):
        ends = np.stack([rower.standing("r_handle"), rower.standing("l_handle")])
        out = 0.06 * (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        shapes.append(
            rower.carried("bar", tube(np.stack([ends[0] - out, ends[1] + out]), 0.016), "tool", "handle")
        )
    return SceneShapes(tuple(shapes), floor)


def _oars(rower: RowerFigure) -> list[tuple[str, str, Part | None]]:
    """Frame that carries each oar, its oarlock, and the side by which it is coloured."""
    if "r_oarlock" in rower.names:
        return [("r_handle", "r_oarlock", "right"), ("l_handle", "l_oarlock", "left")]
    inner = max(
        ("r_handle", "l_handle"), key=lambda name: float(np.linalg.norm(_inboard(rower, name, "oarlock")))
    )
    side: Part = "right" if rower.standing("oarlock")[0] < 0.0 else "left"
    return [(inner, "oarlock", side)]


def _inboard(rower: RowerFigure, handle: str, oarlock: str) -> Floats:
    return rower.standing(handle) - rower.standing(oarlock)


def _oar(rower: RowerFigure, handle: str, oarlock: str) -> tuple[list[tuple[Floats, Ints]], Floats]:
    """Grip, shaft and blade in root axes of the upright posture, and the blade's centre."""
    sweep = oarlock == "oarlock"
    length, end = (_SWEEP_OAR_M, _SWEEP_HANDLE_END_M) if sweep else (_SCULL_M, _HANDLE_END_M)
    grip = rower.standing(handle)
    out = -_inboard(rower, handle, oarlock)
    out /= np.linalg.norm(out)
    start = grip - end * out
    tip = start + length * out
    neck = tip - _BLADE_M * out
    grips = tube(np.stack([start, grip + 0.07 * out]), 0.019)
    shaft = tube(np.stack([grip + 0.07 * out, start + 0.6 * length * out, neck]), [0.020, 0.019, 0.014])
    return [grips, shaft, _blade(neck, out)], tip - 0.5 * _BLADE_M * out


def _blade(neck: Floats, out: Floats) -> tuple[Floats, Ints]:
    """A hatchet blade, square, hollow toward the stern."""
    up, stern = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    outline = [  # share of the length, lower and upper edge, hollow
        (-0.05, -0.014, 0.014, 0.0), (0.12, -0.03, 0.025, 0.012), (0.35, -0.085, 0.065, 0.026),
        (0.7, -0.125, 0.092, 0.024), (1.0, -0.118, 0.098, 0.008),
    ]  # fmt: skip
    rings = []
    for share, low, high, hollow in outline:
        center = neck + share * _BLADE_M * out
        heights = np.linspace(low, high, 5)
        bend = hollow * (1.0 - np.linspace(-1.0, 1.0, 5) ** 2)
        face = [center + h * up - b * stern for h, b in zip(heights, bend, strict=True)]
        back = [point - 0.008 * stern for point in face[::-1]]
        rings.append(np.array([*face, *back]))
    return loft(np.stack(rings))


def _coloured(pieces: list[tuple[Floats, Ints]], side: Part | None) -> list[tuple[tuple[Floats, Ints], Part]]:
    grip, shaft, blade = pieces
    return [(grip, side or "tool"), (shaft, "tool"), (blade, side or "tool")]


def _hull(rower: RowerFigure, water: float) -> tuple[Shape, ...]:
    """A narrow shell, open where the rower sits, with canvas decks before and behind."""
    deck = water + _DECK_ABOVE_WATER_M
    middle = rower.standing(rower.boat)[2] + 0.25
    stations = np.linspace(-1.0, 1.0, 17)
    turn = np.linspace(np.pi, 2.0 * np.pi, 9)
    rings = []
    for share in stations:
        fullness = max(1.0 - abs(share) ** 2.6, 0.02)
        half, depth = _HULL_HALF_WIDTH_M * fullness**0.8, _HULL_DEPTH_M * max(fullness, 0.15) ** 0.5
        across, down = half * np.cos(turn), (deck - 0.02) + depth * np.sin(turn)
        rings.append(np.column_stack([across, down, np.full(9, middle + share * _HULL_HALF_LENGTH_M)]))
    hull = rower.carried(rower.boat, loft(np.stack(rings)), "shell", "hull")
    rails = [
        rower.carried(
            rower.boat,
            box(
                [x, rower.standing("seat")[1] - 0.135 * rower.scale, 0.5 * rower.toe_m[2] - 0.12],
                [0.018, 0.02, 0.85],
            ),
            "frame",
            "rail",
        )
        for x in (-0.09, 0.09)
    ]
    return hull, *rails


def _riggers(rower: RowerFigure, water: float) -> tuple[Shape, ...]:
    """From each pin two stays to the hull, and the pin itself."""
    found, up = [], np.array([0.0, 1.0, 0.0])
    for name in (n for n in rower.names if n.endswith("oarlock")):
        pin = rower.standing(name)
        side = np.sign(pin[0])
        for along in (-0.38, 0.32):
            root = np.array([side * 0.13, water + 0.13, pin[2] + along])
            found.append(
                rower.carried(rower.boat, tube(np.stack([pin - 0.05 * up, root]), 0.011), "frame", "rigger")
            )
        found.append(
            rower.carried(
                rower.boat, tube(np.stack([pin - 0.06 * up, pin + 0.05 * up]), 0.013), "frame", "pin"
            )
        )
    return tuple(found)


def _disc(center: Floats, radius_m: float, half_width_m: float) -> tuple[Floats, Ints]:
    half = np.array([half_width_m, 0.0, 0.0])
    return tube(np.stack([center - half, center + half]), radius_m, 28)
