"""Inverse kinematics of the arms of simulated rowers: the hands are on the handles.

Of all postures with the hand on the handle and its z axis along it (five conditions, seven joints), the one nearest to
a preferred posture: minimise |W (q - q_preferred)|^2 / 2 by Newton's method on the Karush-Kuhn-Tucker equations, for
all knots at once. The handle is first moved from the hand to its place in small steps, which keeps the branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from oarlock.storage.arrays import Floats

ARM_JOINTS = (
    "shoulder_abduction",
    "shoulder_rotation",
    "shoulder_flexion",
    "elbow_flexion",
    "elbow_rotation",
    "hand_abduction",
    "hand_flexion",
)
SIDES = ("r", "l")
_START_EVERY_S = 0.04
_START_STEPS = 10
_FINAL_STEPS = 12
_CONVERGED = 1e-12
_LONGEST_STEP_RAD = 0.5
_MISS_STEPS = 200
_MISS_DAMPING = 1e-2
_BLOCK = 8192


class ArmKinematics(Protocol):
    """What the inverse kinematics needs of a model with the sculler's joint and frame names."""

    @property
    def joint_names(self) -> Sequence[str]:
        """Names of the columns of q."""

    @property
    def frame_names(self) -> Sequence[str]:
        """Names of the frames, root first."""

    def forward_kinematics(self, q: ArrayLike, /) -> Floats:
        """Poses (..., n_frames, 4, 4), root from frame, of q (..., n_joints)."""


@dataclass(frozen=True, eq=False)
class Hands:
    """Both arms' conditions at K postures; side is the second axis, right first.

    ``residual`` (K, 2, 5): hand minus handle, m, then the hand's z along two axes across the handle.
    ``jacobian`` (K, 2, 5, 7); ``axes`` and ``arms`` (K, 2, 7, 3) are the joints' axes and the vectors from
    them to the hand; ``hand_z`` (K, 2, 3) and ``across`` (K, 2, 2, 3) are unit vectors.
    """

    residual: Floats
    jacobian: Floats
    axes: Floats
    arms: Floats
    hand_z: Floats
    across: Floats

    def curvature(self, multipliers: Floats) -> Floats:
        """Second derivative (K, 2, 7, 7) of the residual's product with ``multipliers`` (K, 2, 5)."""
        force = multipliers[..., :3]
        torque = np.einsum("ksa,ksad->ksd", multipliers[..., 3:], self.across)
        moved = _cross(self.axes, self.arms)
        turned = _cross(self.axes, self.hand_z[..., None, :])
        # d2p/dqi dqj = zi x (zj x p) for i before j, hence (force x zi) . (zj x p).
        lower = np.einsum("ksid,ksjd->ksij", _cross(force[..., None, :], self.axes), moved)
        lower += np.einsum("ksid,ksjd->ksij", _cross(torque[..., None, :], self.axes), turned)
        upper = np.triu(lower)
        return np.asarray(upper + np.swapaxes(np.triu(lower, 1), -1, -2), dtype=np.float64)


class GripSolver:
    """Finds arm joints for given seat, trunk and oars."""

    def __init__(self, model: ArmKinematics, weights: Floats) -> None:
        frames = list(model.frame_names)
        joints = list(model.joint_names)
        self._model = model
        self._weights = weights
        self.columns = np.array([[joints.index(f"{side}_{name}") for name in ARM_JOINTS] for side in SIDES])
        self._bases = np.array([frames.index(f"{side}_shoulder") for side in SIDES])
        self._hands = np.array([frames.index(f"{side}_hand") for side in SIDES])
        self._handles = np.array([frames.index(f"{side}_handle") for side in SIDES])
        self._elbows = np.array([frames.index(f"{side}_elbow") for side in SIDES])
        self._wrists = np.array([frames.index(f"{side}_wrist") for side in SIDES])

    def poses(self, q: Floats) -> Floats:
        """Poses (K, n_frames, 4, 4) of q (K, n_joints)."""
        return np.asarray(self._model.forward_kinematics(q), dtype=np.float64)

    def closure(self, q: Floats) -> tuple[Floats, Floats]:
        """Distance hand to handle (K, 2), m, and length of the difference of their z axes (K, 2)."""
        poses = self.poses(q)
        gap = poses[:, self._hands] - poses[:, self._handles]
        return np.linalg.norm(gap[..., :3, 3], axis=-1), np.linalg.norm(gap[..., :3, 2], axis=-1)

    def excess_reach(self, q: Floats) -> Floats:
        """Distance shoulder to handle less the stretched arm's length (K, 2), m; positive is out of reach."""
        points = self.poses(q)[..., :3, 3]
        chain = [points[:, i] for i in (self._bases, self._elbows, self._wrists, self._hands)]
        arm = sum(np.linalg.norm(b - a, axis=-1) for a, b in pairwise(chain))
        return np.asarray(np.linalg.norm(points[:, self._handles] - chain[0], axis=-1) - arm)

    def solve(self, time_s: Floats, q: Floats, preferred: Floats) -> Floats:
        """Set the arms of q (K, n_joints) so that the hands are on the handles, nearest to ``preferred`` (K, 2, 7)."""
        stride = max(1, round(_START_EVERY_S / float(np.median(np.diff(time_s)))))
        coarse = np.unique(np.append(np.arange(0, time_s.size, stride), time_s.size - 1))
        start = self._drawn_to_handles(q[coarse], preferred[coarse])
        spline = make_interp_spline(time_s[coarse], start, k=min(3, coarse.size - 1))
        solved = q.copy()
        for block in np.array_split(np.arange(time_s.size), -(-time_s.size // _BLOCK)):
            guess = np.asarray(spline(time_s[block]), dtype=np.float64)
            arms = self._newton(q[block], guess, preferred[block], 1.0, _FINAL_STEPS)
            solved[block[:, None, None], self.columns] = arms
        return solved

    def nearest_miss(self, q: Floats, preferred: Floats) -> Floats:
        """Smallest distance from hand to handle (K, 2), m, with the hand along the handle; 0 if it reaches."""
        arms = preferred
        for _ in range(_MISS_STEPS):
            hands = self._conditions(self._with_arms(q, arms), None, 1.0)
            transposed = np.swapaxes(hands.jacobian, -1, -2)
            damped = hands.jacobian @ transposed + _MISS_DAMPING * np.eye(hands.residual.shape[-1])
            arms = arms - (transposed @ np.linalg.solve(damped, hands.residual[..., None]))[..., 0]
        return np.asarray(np.linalg.norm(hands.residual[..., :3], axis=-1), dtype=np.float64)

    def _drawn_to_handles(self, q: Floats, preferred: Floats) -> Floats:
        arms = preferred
        for step in range(1, _START_STEPS + 1):
            arms = self._newton(q, arms, preferred, step / _START_STEPS, 3)
        return self._newton(q, arms, preferred, 1.0, _FINAL_STEPS)

    def _newton(self, q: Floats, arms: Floats, preferred: Floats, drawn: float, steps: int) -> Floats:
        """At most ``steps`` Newton steps with the handle ``drawn`` (0..1) from the preferred hand's place."""
        start = self._with_arms(q, preferred)[:, self._hands] if drawn < 1.0 else None
        multipliers = np.zeros((*arms.shape[:2], 5))
        for _ in range(steps):
            hands = self._conditions(self._with_arms(q, arms), start, drawn)
            step, multipliers = self._step(hands, arms - preferred, multipliers)
            longest = np.abs(step).max(axis=-1, keepdims=True)
            arms = arms + step * np.minimum(1.0, _LONGEST_STEP_RAD / np.maximum(longest, _CONVERGED))
            if float(np.abs(step).max()) < _CONVERGED:
                break
        return arms

    def _with_arms(self, q: Floats, arms: Floats) -> Floats:
        posture = q.copy()
        posture[:, self.columns] = arms
        return self.poses(posture)

    def _conditions(self, poses: Floats, start: Floats | None, drawn: float) -> Hands:
        hand = poses[:, self._hands]
        target = poses[:, self._handles]
        if start is not None:
            target = drawn * target + (1.0 - drawn) * start
        handle_z = target[..., :3, 2] / np.linalg.norm(target[..., :3, 2], axis=-1, keepdims=True)
        across = _across(handle_z)
        chain = self._bases[:, None] + np.arange(len(ARM_JOINTS))
        axes = poses[:, chain][..., :3, 2]
        arms = hand[..., None, :3, 3] - poses[:, chain][..., :3, 3]
        hand_z = hand[..., :3, 2]
        residual = np.concatenate(
            [hand[..., :3, 3] - target[..., :3, 3], np.einsum("ksad,ksd->ksa", across, hand_z)], axis=-1
        )
        turned = np.einsum("ksad,ksjd->ksaj", across, _cross(axes, hand_z[..., None, :]))
        moved = np.swapaxes(_cross(axes, arms), -1, -2)
        return Hands(residual, np.concatenate([moved, turned], axis=-2), axes, arms, hand_z, across)

    def _step(self, hands: Hands, offset: Floats, multipliers: Floats) -> tuple[Floats, Floats]:
        joints, rows = len(ARM_JOINTS), hands.residual.shape[-1]
        matrix = np.zeros((*offset.shape[:2], joints + rows, joints + rows))
        matrix[..., :joints, :joints] = np.diag(self._weights) + hands.curvature(multipliers)
        matrix[..., joints:, :joints] = hands.jacobian
        matrix[..., :joints, joints:] = np.swapaxes(hands.jacobian, -1, -2)
        right = np.concatenate([-self._weights * offset, -hands.residual], axis=-1)
        solution = np.linalg.solve(matrix, right[..., None])[..., 0]
        return solution[..., :joints], solution[..., joints:]


def _across(unit: Floats) -> Floats:
    """Two unit vectors (..., 2, 3) across ``unit`` (..., 3); smooth unless it stands upright."""
    upright = np.array([0.0, 1.0, 0.0])
    first = _cross(upright, unit)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, _cross(unit, first)], axis=-2)


def _cross(a: Floats, b: Floats) -> Floats:
    """The cross product of vectors (..., 3), to the bit that of `np.cross`, which takes several times as long."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
