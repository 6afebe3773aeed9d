"""`Arm`: closed-form inverse kinematics of an arm with three shoulder, one elbow and three wrist hinges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from oarlock.evaluation.markers.attachments import Attachment, check_frames
from oarlock.evaluation.markers.hinge_triple import Line, hinge_angle, hinge_triple, turn
from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.model.description import pose_of
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

_MEET_M: Final = 1e-6
"""Largest distance between axes that count as intersecting, m."""
_STRETCHED: Final = 1e-3
"""Smallest ratio of the elbow circle's radius to the upper arm.

Below it a millimetre at the elbow rotates the arm by radians.
"""


@dataclass(frozen=True, eq=False)
class ArmPostures:
    """Joint values of an arm over time.

    Args:
        joint_names: the arm's joints from the shoulder down: four, five (with forearm rotation) or seven.
        q: (T, joints) rad.
        reachable: (T,) true if the arm can reach the distance from shoulder to wrist. Otherwise the arm is stretched or
            folded toward the target.
        miss_m: (T,) distance by which the target is out of reach, m; 0 where reachable.
        stretched: (T,) true if shoulder, elbow and wrist lie on one line. The direction of the elbow is then
            undetermined, and `swivel_rad` 0 is used.
        pole: (T,) true if the first and third hinge of the shoulder (or of the wrist) lie on one line.
        swivel_rad: (T,) angle of the elbow on its circle about the line from shoulder to wrist, measured from the
            lowest point, right-handed about that line. NaN where stretched.
    """

    joint_names: tuple[str, ...]
    q: Floats
    reachable: Bools
    miss_m: Floats
    stretched: Bools
    pole: Bools
    swivel_rad: Floats


class Arm:
    """An arm of a model: hinges that meet in the shoulder, one at the elbow, up to three that meet in the wrist.

    Position of the wrist, orientation of the hand and the angle of the elbow on its circle determine all joints in
    closed form: the elbow's angle follows from the law of cosines, the shoulder's rotation from two directions, and
    each triple of hinges from its rotation. If two postures are equivalent, the one nearer to the middle of the soft
    limits is returned.

    Source: D. Tolani, A. Goswami, N. I. Badler 2000, "Real-time inverse kinematics techniques for anthropomorphic
    limbs", Graphical Models 62(5). This implementation accepts any intersecting axes, not only coordinate axes, and a
    measured elbow instead of the swivel angle.

    Args:
        model: with the person's lengths.
        base: frame that carries the shoulder, such as `r_shoulder`.
        tip: last frame of the arm, such as `r_hand`, or `r_wrist` for an arm without the hand's joints.

    Raises:
        DataError: no such frames, another number or kind of joints, or axes that do not meet.
    """

    def __init__(self, model: Model, base: str = "shoulder", tip: str = "hand") -> None:
        check_frames(model, (base, tip), "arm")
        self.model, self.base, self.tip = model, base, tip
        joints = _hinges_between(model, base, tip)
        self.joint_names = tuple(joints)
        self._lines = _lines(model, base, joints)
        self._middle, self._width = _habits(model, joints)
        self._shoulder = _meeting(self._lines[:3], f"arm from {base}: the first three hinges")
        self._wrist = self._wrist_point()
        elbow = self._lines[3]
        # the elbow is the point of its axis that is nearest to the shoulder
        self._elbow = elbow.point + elbow.axis * (elbow.axis @ (self._shoulder - elbow.point))
        rest = model.forward_kinematics(np.zeros(len(model.coordinate_names)))
        self._root_from_base = rest[model.frame_names.index(base)]
        self._rest_rotation = (np.linalg.inv(self._root_from_base) @ rest[model.frame_names.index(tip)])[
            :3, :3
        ]
        up = np.asarray(model.describe().world.up)
        self._down = -self._root_from_base[:3, :3].T @ up
        self._reach = _cosine(self._lines[3], self._wrist, self._shoulder)

    @property
    def reach_m(self) -> tuple[float, float]:
        """Least and greatest distance from shoulder to wrist, m."""
        middle, swing, _ = self._reach
        return float(np.sqrt(max(middle - swing, 0.0))), float(np.sqrt(middle + swing))

    def solve(
        self,
        wrist_m: ArrayLike,
        elbow_m: ArrayLike | None = None,
        *,
        swivel_rad: ArrayLike | None = None,
        tip_rotation: ArrayLike | None = None,
        root_from_base: ArrayLike | None = None,
    ) -> ArmPostures:
        """Joint values for given positions of the wrist.

        Args:
            wrist_m: (T, 3) or (3,) root axes, m.
            elbow_m: of the same shape: a point near the elbow, such as a measured elbow; the nearest point of its
                circle is used.
            swivel_rad: (T,) or one number instead of `elbow_m`; see `ArmPostures`.
            tip_rotation: (T, 3, 3) or (3, 3) root-from-tip; without it the joints below the elbow are left out.
            root_from_base: (T, 4, 4) or (4, 4) pose of the base frame; None uses the model's rest posture.

        Raises:
            DataError: another shape, or not exactly one of `elbow_m` and `swivel_rad`.
        """
        if (elbow_m is None) == (swivel_rad is None):
            raise DataError(
                "arm: give either elbow_m or swivel_rad, which say where the elbow is on its circle"
            )
        pose = (
            self._root_from_base if root_from_base is None else np.asarray(root_from_base, dtype=np.float64)
        )
        wrist = _in_base(pose, _rows(wrist_m, 3, "wrist_m"))
        along = wrist - self._shoulder
        q4, miss = self._elbow_angle(np.linalg.norm(along, axis=1))
        unit = along / np.linalg.norm(along, axis=1, keepdims=True)
        low, side = self._circle(unit)
        if elbow_m is not None:
            out = _in_base(pose, _rows(elbow_m, 3, "elbow_m")) - self._shoulder
            swivel = np.arctan2(np.sum(out * side, axis=1), np.sum(out * low, axis=1))
        else:
            swivel = np.broadcast_to(np.asarray(swivel_rad, dtype=np.float64), (len(wrist),))
        bent_wrist = turn(self._lines[3], q4, self._wrist) - self._shoulder
        elbow = np.broadcast_to(self._elbow - self._shoulder, bent_wrist.shape)
        radius = np.linalg.norm(np.cross(elbow, bent_wrist), axis=1) / np.linalg.norm(bent_wrist, axis=1)
        stretched = radius < _STRETCHED * np.linalg.norm(self._elbow - self._shoulder)
        swivel = np.where(stretched, 0.0, swivel)
        outward = np.cos(swivel)[:, None] * low + np.sin(swivel)[:, None] * side
        shoulder = _from_two(unit, outward) @ np.swapaxes(
            _from_two(bent_wrist, self._outward(elbow, bent_wrist)), 1, 2
        )
        first, pole = self._triple(shoulder, slice(0, 3))
        q, pole_below = self._below_elbow(shoulder, q4, tip_rotation, pose, len(wrist))
        return ArmPostures(
            joint_names=self.joint_names[: 4 + q.shape[1]],
            q=np.column_stack([first, q4, q]),
            reachable=np.asarray(miss == 0.0),
            miss_m=miss,
            stretched=stretched,
            pole=pole | pole_below,
            swivel_rad=np.where(stretched, np.nan, swivel),
        )

    def _wrist_point(self) -> Floats:
        """Intersection of the axes below the elbow; with a single axis, the tip's origin."""
        if len(self._lines) >= 7:
            return _meeting(self._lines[4:7], f"arm to {self.tip}: the last three hinges")
        tree = PointTree(self.model, [Attachment("tip", self.tip, np.zeros(3))])
        at = tree.at(np.zeros((1, len(self.model.coordinate_names))))[0, 0]
        pose = self.model.forward_kinematics(np.zeros(len(self.model.coordinate_names)))
        return np.asarray(_in_base(pose[self.model.frame_names.index(self.base)], at[None])[0])

    def _elbow_angle(self, distance: Floats) -> tuple[Floats, Floats]:
        """Law of cosines: d^2 = middle + swing cos(q - turned). The second result is the distance beyond reach."""
        middle, swing, turned = self._reach
        nearest, furthest = self.reach_m
        # rounding errors of a stretched arm do not count as out of reach
        miss = np.maximum(np.maximum(distance - furthest, nearest - distance), 0.0)
        miss[miss < 1e-12] = 0.0
        bend = np.arccos(np.clip((distance**2 - middle) / swing, -1.0, 1.0))
        both = np.stack([turned + bend, turned - bend], axis=1)
        return self._nearer(both[:, :, None], slice(3, 4))[:, 0], miss

    def _circle(self, unit: Floats) -> tuple[Floats, Floats]:
        """Directions from the circle's centre to its lowest point, and to the point a quarter turn further."""
        down = np.broadcast_to(self._down, unit.shape)
        # if the line is vertical any direction is possible: the model's forward is used
        upright = np.linalg.norm(np.cross(unit, down), axis=1) < 1e-9
        forward = self._root_from_base[:3, :3].T @ np.asarray(self.model.describe().world.forward)
        reference = np.where(upright[:, None], forward, down)
        low = reference - unit * np.sum(reference * unit, axis=1, keepdims=True)
        low /= np.linalg.norm(low, axis=1, keepdims=True)
        return low, np.cross(unit, low)

    def _outward(self, elbow: Floats, wrist: Floats) -> Floats:
        unit = wrist / np.linalg.norm(wrist, axis=1, keepdims=True)
        out = elbow - unit * np.sum(elbow * unit, axis=1, keepdims=True)
        length = np.linalg.norm(out, axis=1, keepdims=True)
        # for a stretched arm any direction perpendicular to the elbow's axis is possible
        across = np.cross(np.broadcast_to(self._lines[3].axis, unit.shape), unit)
        return np.asarray(np.where(length > 1e-12, out, across))

    def _triple(self, rotation: Floats, which: slice) -> tuple[Floats, Bools]:
        both, pole = hinge_triple(rotation, *(line.axis for line in self._lines[which]))
        return self._nearer(both, which), pole

    def _below_elbow(
        self,
        shoulder: Floats,
        q4: Floats,
        tip_rotation: ArrayLike | None,
        pose: Floats,
        rows: int,
    ) -> tuple[Floats, Bools]:
        if tip_rotation is None or len(self._lines) == 4:
            return np.empty((rows, 0)), np.zeros(rows, dtype=bool)
        given = np.asarray(tip_rotation, dtype=np.float64)
        if given.shape not in ((3, 3), (rows, 3, 3)):
            raise DataError(f"arm: tip_rotation has shape {given.shape}; expected (3, 3) or ({rows}, 3, 3)")
        wanted = np.swapaxes(pose[..., :3, :3], -1, -2) @ given @ self._rest_rotation.T
        bent = np.swapaxes(turn(self._lines[3], q4), 1, 2) @ np.swapaxes(shoulder, 1, 2)
        left = np.broadcast_to(bent @ wanted, (rows, 3, 3))
        if len(self._lines) == 5:
            return hinge_angle(left, self._lines[4].axis)[:, None], np.zeros(rows, dtype=bool)
        return self._triple(left, slice(4, 7))

    def _nearer(self, both: Floats, which: slice) -> Floats:
        """The one of two wrapped solutions (T, 2, n) that is nearer to the middle of the soft limits, (T, n)."""
        middle, width = self._middle[which], self._width[which]
        wrapped = middle + np.mod(both - middle + np.pi, 2.0 * np.pi) - np.pi
        away = np.sum(((wrapped - middle) / width) ** 2, axis=2)
        return np.asarray(wrapped[np.arange(len(both)), np.argmin(away, axis=1)])


def _rows(value: ArrayLike, width: int, name: str) -> Floats:
    given = np.atleast_2d(np.asarray(value, dtype=np.float64))
    return real_array(given, (None, width), f"arm, {name}")


def _in_base(pose: Floats, points: Floats) -> Floats:
    return np.asarray(np.einsum("...ji,...j->...i", pose[..., :3, :3], points - pose[..., :3, 3]))


def _from_two(main: Floats, other: Floats) -> Floats:
    """Right-handed axes (T, 3, 3): the first along `main`, the second toward `other`."""
    x = main / np.linalg.norm(main, axis=1, keepdims=True)
    z = np.cross(x, other)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _cosine(line: Line, wrist: Floats, shoulder: Floats) -> tuple[float, float, float]:
    """Squared distance of shoulder and wrist as middle + swing cos(q - turned), from three angles of the elbow."""
    places = turn(line, np.array([0.0, 0.5 * np.pi, np.pi]), wrist) - shoulder
    zero, quarter, half = np.sum(places**2, axis=1)
    middle = 0.5 * (zero + half)
    return (
        middle,
        float(np.hypot(zero - middle, quarter - middle)),
        float(np.arctan2(quarter - middle, zero - middle)),
    )


def _hinges_between(model: Model, base: str, tip: str) -> list[str]:
    described = model.describe()
    frames = {f.name: f for f in described.frames}
    kinds = {j.name: j.kind for j in described.joints}
    found: list[str] = []
    here = tip
    while here != base:
        frame = frames[here]
        if frame.parent is None:
            raise DataError(f'arm: frame "{tip}" does not hang on "{base}"')
        if frame.joint is not None and kinds[frame.joint] != "fixed":
            found.insert(0, frame.joint)
        here = frame.parent
    if len(found) not in (4, 5, 7) or any(kinds[joint] != "hinge" for joint in found):
        raise DataError(
            f'arm from "{base}" to "{tip}": joints are {", ".join(f"{j} ({kinds[j]})" for j in found)}; expected '
            "hinges: three in the shoulder, one at the elbow, and none, one or three behind it"
        )
    return found


def _lines(model: Model, base: str, joints: list[str]) -> tuple[Line, ...]:
    """The hinge axes in the base frame at coordinates 0, computed exactly from poses after half turns."""
    tip = np.zeros((1, len(model.coordinate_names)))
    pose = model.forward_kinematics(tip)[0]
    base_pose = pose[model.frame_names.index(base)]
    frames = model.describe().frames
    found = []
    for joint in joints:
        frame = next(f for f in frames if f.joint == joint)
        hinge = pose[model.frame_names.index(frame.parent or "")] @ pose_of(frame.before)
        axis, point = hinge[:3, 2] * frame.sign, hinge[:3, 3]
        found.append(Line(base_pose[:3, :3].T @ axis, _in_base(base_pose, point[None])[0]))
    return tuple(found)


def _meeting(lines: tuple[Line, ...], what: str) -> Floats:
    """The intersection of axes."""
    across = [np.eye(3) - np.outer(line.axis, line.axis) for line in lines]
    point = np.linalg.solve(sum(across), sum(a @ line.point for a, line in zip(across, lines, strict=True)))
    apart = max(
        float(np.linalg.norm(a @ (point - line.point))) for a, line in zip(across, lines, strict=True)
    )
    if apart > _MEET_M:
        raise DataError(
            f"{what} miss each other by {2e3 * apart:.3g} mm; the closed form takes axes that meet"
        )
    return np.asarray(point)


def _habits(model: Model, joints: list[str]) -> tuple[Floats, Floats]:
    limits = {j.name: j.limits for j in model.describe().joints}
    both = np.array([limits[joint] for joint in joints], dtype=np.float64)
    return both.mean(axis=1), np.diff(both, axis=1)[:, 0]
