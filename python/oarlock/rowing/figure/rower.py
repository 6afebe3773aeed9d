"""A rower's frames over time, and trunk, head, legs and seat drawn around them in usual sizes, after Winter (2009)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from oarlock.model import Shape, Strand
from oarlock.model.shapes import Part, box, ellipsoid, loft
from oarlock.storage.arrays import Floats, Ints

if TYPE_CHECKING:
    from oarlock import Model

Solid = tuple[Floats, Ints]

THIGH, SHANK = 0.443, 0.445
"""m, of a rower whose trunk is 0.52 m: 0.245 and 0.246 of a stature of 1.81 m (Winter 2009)."""
_USUAL_TRUNK_M = 0.520
_HIP_HALF_WIDTH_M = 0.085
_ANKLE_BELOW_HIP_M = 0.13
_LEGS_SPARE = 0.985
_LEG_M = 0.045


class RowerFigure:
    """Poses of a rower's frames, and shapes built in root axes in the upright posture, where all joints are 0."""

    def __init__(self, model: Model, q: Floats) -> None:
        self.model = model
        self.names = list(model.frame_names)
        q = np.where(np.isnan(q).all(axis=0), 0.0, q)
        self.poses = np.asarray(model.forward_kinematics(q))
        self.upright = np.asarray(model.forward_kinematics(np.zeros(q.shape[1])))
        self.afloat = any(name.endswith("oarlock") for name in self.names)
        self.boat = "hull" if "hull" in self.names else "root"
        self.scale = float(np.linalg.norm(self.mid_shoulder - self.standing("seat"))) / _USUAL_TRUNK_M
        self.toe_m = self._stretcher()

    def standing(self, frame: str) -> Floats:
        """Origin of a frame in the upright posture, (3,) m."""
        place: Floats = self.upright[self.names.index(frame), :3, 3]
        return place

    @property
    def mid_shoulder(self) -> Floats:
        """Middle between both shoulders in the upright posture, (3,) m."""
        return 0.5 * (self.standing("r_shoulder") + self.standing("l_shoulder"))

    def over_time(self, frame: str) -> Floats:
        """Poses (T, 4, 4) of a frame."""
        poses: Floats = self.poses[:, self.names.index(frame)]
        return poses

    def carried(self, frame: str, solid: Solid, part: Part, label: str) -> Shape:
        """A solid given in root axes of the upright posture, carried by a frame."""
        pose = self.upright[self.names.index(frame)]
        return Shape(frame, (solid[0] - pose[:3, 3]) @ pose[:3, :3], solid[1], part, label)

    def trunk_and_head(self) -> tuple[Shape, ...]:
        """Trunk, neck and head, on the frame that carries the shoulders."""
        chest = "chest" if "chest" in self.names else "r_shoulder"
        hip, top = self.standing("seat"), self.mid_shoulder
        wide = float(np.linalg.norm(self.standing("r_shoulder") - self.standing("l_shoulder")))
        s = self.scale
        profile = [  # share of the way up, half width, half depth
            (-0.10, 0.11 * s, 0.085 * s), (-0.03, 0.155 * s, 0.115 * s), (0.12, 0.155 * s, 0.11 * s),
            (0.35, 0.135 * s, 0.095 * s), (0.62, 0.36 * wide, 0.11 * s), (0.84, 0.40 * wide, 0.105 * s),
            (0.97, 0.36 * wide, 0.08 * s), (1.06, 0.15 * wide, 0.055 * s), (1.20, 0.045 * s, 0.05 * s),
        ]  # fmt: skip
        turn = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
        rings = [
            hip
            + share * (top - hip)
            + np.column_stack([w * np.sin(turn), np.zeros_like(turn), d * np.cos(turn)])
            for share, w, d in profile
        ]
        head = ellipsoid(top + np.array([0.0, 0.225 * s, 0.015]), [0.075 * s, 0.115 * s, 0.095 * s], 18)
        return (
            self.carried(chest, loft(np.stack(rings)), "body", "shape of the trunk"),
            self.carried(chest, head, "body", "head"),
        )

    def legs(self) -> tuple[Strand, ...]:
        """Hip, knee, ankle and toe of both legs: knees bent upwards, as two rods between hip and stretcher are."""
        boat = self.over_time(self.boat)
        away = self.over_time("seat")[:, :3, 3] - boat[:, :3, 3]
        hip = np.einsum("tji,tj->ti", boat[:, :3, :3], away)
        strands = []
        for side, sign in (("right", -1.0), ("left", 1.0)):
            start = hip + np.array([sign * _HIP_HALF_WIDTH_M, 0.0, 0.0])
            ankle = np.broadcast_to(self.toe_m + np.array([sign * 0.08, 0.0, 0.0]), start.shape)
            knee = _knee(start, ankle, THIGH * self.scale, SHANK * self.scale)
            toe = ankle + np.array([0.0, 0.13, 0.10])
            chain = np.stack([start, knee, ankle, toe], axis=1)
            in_root = np.einsum("tij,tkj->tki", boat[:, :3, :3], chain) + boat[:, None, :3, 3]
            strands.append(Strand(in_root, _LEG_M * self.scale, "body", f"{side} leg"))
        return tuple(strands)

    def chain(self) -> tuple[Strand, ...]:
        """An ergometer's chain, from where it leaves the machine to the handle."""
        if not set(self.names) >= {"chain_raised", "bar"}:
            return ()
        ends = [self.over_time(frame)[:, :3, 3] for frame in ("chain_raised", "bar")]
        return (Strand(np.stack(ends, axis=1), 0.006, "tool", "chain"),)

    def _stretcher(self) -> Floats:
        """Where the ankles stand in the boat's axes: legs are just straight where the seat is furthest back."""
        boat = self.over_time(self.boat)
        hip = np.einsum("tji,tj->ti", boat[:, :3, :3], self.over_time("seat")[:, :3, 3] - boat[:, :3, 3])
        furthest = float(np.nanpercentile(hip[:, 2], 0.5))
        reach = _LEGS_SPARE * (THIGH + SHANK) * self.scale
        along = float(np.sqrt(reach**2 - _ANKLE_BELOW_HIP_M**2))
        return np.array([0.0, float(np.nanmedian(hip[:, 1])) - _ANKLE_BELOW_HIP_M, furthest + along])

    def seat_and_stretcher(self) -> tuple[Shape, ...]:
        """Seat on its rails, and the board that the feet stand on."""
        under = self.standing("seat") - np.array([0.0, 0.105 * self.scale, 0.0])
        board = self.toe_m + np.array([0.0, 0.05, 0.085])
        plate = box([0.0, 0.0, 0.0], [0.30, 0.30, 0.02])
        slope = np.deg2rad(-42.0)  # about 42 deg is usual
        tilt = np.array(
            [[1.0, 0.0, 0.0], [0.0, np.cos(slope), np.sin(slope)], [0.0, -np.sin(slope), np.cos(slope)]]
        )
        start = self.standing(self.boat)
        return (
            self.carried("seat", box(under, [0.29, 0.03, 0.23]), "seat", "seat"),
            self.carried(self.boat, (start + board + plate[0] @ tilt.T, plate[1]), "seat", "stretcher"),
        )


def _knee(hip: Floats, ankle: Floats, thigh_m: float, shank_m: float) -> Floats:
    """Where two rods between hip and ankle meet (T, 3), bent upwards; straight where they do not reach."""
    line = ankle - hip
    apart = np.linalg.norm(line, axis=1)
    along = (apart**2 + thigh_m**2 - shank_m**2) / (2.0 * apart)
    off = np.sqrt(np.maximum(thigh_m**2 - along**2, 0.0))
    direction = line / apart[:, None]
    up = np.array([0.0, 1.0, 0.0]) - direction[:, 1:2] * direction
    up /= np.linalg.norm(up, axis=1)[:, None]
    share = np.where(apart < thigh_m + shank_m, along, apart * thigh_m / (thigh_m + shank_m))
    knee: Floats = hip + share[:, None] * direction + off[:, None] * up
    return knee
