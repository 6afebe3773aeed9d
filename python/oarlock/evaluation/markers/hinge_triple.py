"""Angles of three hinges with intersecting axes from their combined rotation, for `Arm`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.storage.arrays import Bools, Floats

_POLE: Final = 1e-6
"""Smallest sine between first and third axis; below it only the sum of their angles is determined."""


@dataclass(frozen=True, eq=False)
class Line:
    """An axis in space: unit vector (3,) and a point (3,) on it, m."""

    axis: Floats
    point: Floats


def turn(line: Line, angle_rad: Floats, point: Floats | None = None) -> Floats:
    """Rotations (T, 3, 3) about a line, or a point (3,) rotated about it, (T, 3)."""
    rotation = matrix_from_quat(quat_from_rotvec(np.asarray(angle_rad)[:, None] * line.axis))
    return rotation if point is None else line.point + rotation @ (point - line.point)


def hinge_angle(rotation: Floats, axis: Floats) -> Floats:
    """The angle (T,) about an axis that fits a rotation (T, 3, 3) best."""
    across = _across(axis)
    turned = rotation @ across
    return np.asarray(np.arctan2(np.cross(across, turned) @ axis, turned @ across))


def hinge_triple(rotation: Floats, first: Floats, second: Floats, third: Floats) -> tuple[Floats, Bools]:
    """Both triples of angles (T, 2, 3) with R = Exp(first q1) Exp(second q2) Exp(third q3), and poles (T,).

    The angle between the first and the third axis determines the second angle; the other two follow from directions. At
    a pole the first angle is 0. Axes may have any directions with which the rotation can be reached.

    Source: B. Paden 1986, "Kinematics and control of robot manipulators" (subproblems 1 and 2); for orthogonal
    neighbours these are Euler or Cardan angles.

    Args:
        rotation: (T, 3, 3).
        first: (3,) unit vector, and so on, in the rotation's axes with all angles 0.
        second: (3,).
        third: (3,).
    """
    flat = third - second * (second @ third)
    cosine, sine = first @ flat, first @ np.cross(second, third)
    level = (first @ second) * (second @ third)
    turned = np.arctan2(sine, cosine)
    wanted = (rotation @ third) @ first
    bend = np.arccos(np.clip((wanted - level) / np.hypot(cosine, sine), -1.0, 1.0))
    found, poles = [], []
    for q2 in (turned + bend, turned - bend):
        q1, pole = _first_angle(rotation, first, turn(Line(second, np.zeros(3)), q2) @ third, third)
        undone = np.swapaxes(turn(Line(first, np.zeros(3)), q1) @ turn(Line(second, np.zeros(3)), q2), 1, 2)
        found.append(np.stack([q1, q2, hinge_angle(undone @ rotation, third)], axis=1))
        poles.append(pole)
    return np.stack(found, axis=1), np.asarray(poles[0] | poles[1])


def _first_angle(rotation: Floats, first: Floats, bent: Floats, third: Floats) -> tuple[Floats, Bools]:
    wanted = rotation @ third
    start = bent - np.outer(bent @ first, first)
    end = wanted - np.outer(wanted @ first, first)
    pole = np.linalg.norm(start, axis=1) < _POLE
    angle = np.arctan2(np.cross(start, end) @ first, np.sum(start * end, axis=1))
    return np.where(pole, 0.0, angle), pole


def _across(axis: Floats) -> Floats:
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = other - axis * (axis @ other)
    return np.asarray(across / np.linalg.norm(across))
