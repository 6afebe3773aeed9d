"""A track as a skeleton: one node per joint centre, with its turn since the neutral pose. For BVH and glTF.

The pose of a frame in its parent is (before M after), see `opensim_body`. A node of the skeleton is the frame's body
with its origin at the joint's centre, before `after`: so a child turns about its own origin. A frame without a joint
keeps its origin.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from oarlock.formats.export.plain_names import PlainNames
from oarlock.model.coordinates import with_untold_at_zero
from oarlock.model.description import pose_of
from oarlock.model.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_product,
    rotvec_between,
)
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.even_times import even_times
from oarlock.tracking.places import poses_of

if TYPE_CHECKING:
    from oarlock.tracking.track import Track

STEADY_M = 1e-9
"""Centres that move less than this in their parent's axes are constant: rounding of float64 over a body's length."""
EVEN_SHARE = 1e-6
"""Share of a step by which stamps of an even clock differ from it by rounding."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Nodes in the order of the model's frames, parents first.

    Args:
        names: the joints' (`r_shoulder` for `r_shoulder_flexion` and `r_shoulder_abduction` at one centre), or the
            frame's where no joint moves; plain and unique.
        parents: index of each node's parent; -1 for the root.
        rest_m: (n, 3) joint centres in the neutral pose, m, ground axes.
        tips_m: (n, 3) origin of the frame from its joint centre in the neutral pose, m, ground axes.
        time_s: (T,) times from 0 on.
        position_m: (T, n, 3) joint centres, m, ground axes.
        turn: (T, n, 3, 3) rotation of each body since the neutral pose, ground axes.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest_m: Floats
    tips_m: Floats
    time_s: Floats
    position_m: Floats
    turn: Floats

    def local(self, node: int) -> tuple[Floats, Floats]:
        """Position (T, 3) in m and rotation (T, 3, 3) of a node in the axes of its parent."""
        return self._local[node]

    @cached_property
    def _local(self) -> tuple[tuple[Floats, Floats], ...]:
        return tuple(self._in_parent(node) for node in range(len(self.names)))

    def _in_parent(self, node: int) -> tuple[Floats, Floats]:
        parent = self.parents[node]
        if parent < 0:
            return self.position_m[:, node], self.turn[:, node]
        parent_from_ground = np.swapaxes(self.turn[:, parent], 1, 2)
        between = self.position_m[:, node] - self.position_m[:, parent]
        return np.einsum("tij,tj->ti", parent_from_ground, between), parent_from_ground @ self.turn[:, node]

    def offset_m(self, node: int) -> Floats:
        """Joint centre from that of the parent in the neutral pose, (3,) m; of the root from the origin."""
        parent = self.parents[node]
        offset: Floats = self.rest_m[node] - (self.rest_m[parent] if parent >= 0 else 0.0)
        return offset

    def slides(self, node: int) -> bool:
        """Whether a node moves in the axes of its parent; the root always counts as moving."""
        return self.parents[node] < 0 or bool(
            np.abs(self.local(node)[0] - self.offset_m(node)).max() > STEADY_M
        )

    def children(self, node: int) -> list[int]:
        """Indices of the nodes whose parent is this one."""
        return [k for k, parent in enumerate(self.parents) if parent == node]


def skeleton_of(track: Track, ground_from_root: Floats) -> tuple[Skeleton, tuple[str, ...]]:
    """The skeleton of a track with its model, and notes on rows that were left out.

    Rows in which a joint lacks a reading are left out.
    """
    assert track.model is not None
    description = track.model.describe()
    frames = description.frames
    index = {frame.name: k for k, frame in enumerate(frames)}
    moving = {joint.name for joint in description.joints if joint.kind != "fixed"}
    after = np.stack([pose_of(frame.after if frame.joint in moving else None) for frame in frames])
    q = with_untold_at_zero(track.q)
    known: Bools = np.logical_and.reduce(np.isfinite(q), axis=1)
    rest = np.array(
        [x for joint in description.joints for x in np.ravel(joint.rest)[: len(joint.coordinates)]]
    )
    poses, rest_poses = (
        ground_from_root @ of_rows @ np.linalg.inv(after)
        for of_rows in (poses_of(track, np.flatnonzero(known)), track.model.forward_kinematics(rest[None]))
    )
    made = Skeleton(
        tuple(frame.joint or "" for frame in frames),
        tuple(-1 if frame.parent is None else index[frame.parent] for frame in frames),
        rest_poses[0, :, :3, 3],
        np.einsum("nij,nj->ni", rest_poses[0, :, :3, :3], after[:, :3, 3]),
        track.time_s[known] - track.time_s[known][0],
        poses[..., :3, 3],
        poses[..., :3, :3] @ np.swapaxes(rest_poses[..., :3, :3], -1, -2),
    )
    left = int((~known).sum())
    notes = (
        (f"{left} of {len(known)} rows left out of animations: a reading is missing there.",) if left else ()
    )
    return _merged(made, [frame.name for frame in frames]), notes


def _merged(skeleton: Skeleton, frame_names: Sequence[str]) -> Skeleton:
    """One node for joints that share their centre, such as the three hinges of a shoulder, with its final name."""
    ends = list(range(len(skeleton.names)))
    for k in reversed(ends):
        children = skeleton.children(k)
        if len(children) == 1 and k > 0 and _same_centre(skeleton, k, children[0]):
            ends[k] = ends[children[0]]
    kept = [k for k, end in enumerate(ends) if k == end]
    place = {k: i for i, k in enumerate(kept)}
    first = {end: k for k, end in reversed(list(enumerate(ends)))}  # of a chain of merged nodes
    above = [skeleton.parents[first[k]] for k in kept]
    joints: dict[int, list[str]] = {end: [] for end in kept}
    for k, end in enumerate(ends):
        joints[end] += filter(None, [skeleton.names[k]])
    names = PlainNames()
    return Skeleton(
        tuple(names.give(_common_name(joints[k]) or frame_names[k]) for k in kept),
        tuple(-1 if parent < 0 else place[ends[parent]] for parent in above),
        skeleton.rest_m[kept],
        skeleton.tips_m[kept],
        skeleton.time_s,
        skeleton.position_m[:, kept],
        skeleton.turn[:, kept],
    )


def _common_name(joints: Sequence[str]) -> str:
    """The words with which all names begin: `r_shoulder` of `r_shoulder_flexion` and `r_shoulder_rotation`."""
    words = zip(*(name.split("_") for name in joints), strict=False)
    return "_".join(same[0] for same in itertools.takewhile(lambda same: len(set(same)) == 1, words))


def _same_centre(skeleton: Skeleton, node: int, child: int) -> bool:
    return bool(np.abs(skeleton.offset_m(child)).max() < STEADY_M) and not skeleton.slides(child)


def evenly(skeleton: Skeleton) -> tuple[Skeleton, tuple[str, ...]]:
    """The skeleton at even steps, which BVH needs, and a note if rows were interpolated.

    Positions are interpolated linearly, rotations at constant angular velocity, at the median step.
    """
    time_s = skeleton.time_s
    if len(time_s) < 2:
        return skeleton, ()
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    if np.abs(steps - step_s).max() <= EVEN_SHARE * step_s:
        return skeleton, ()
    even_times(time_s, step_s, "animation.bvh")
    even_s = np.linspace(0.0, step_s * int(time_s[-1] / step_s), int(time_s[-1] / step_s) + 1)
    behind = np.clip(np.searchsorted(time_s, even_s, side="right"), 1, len(time_s) - 1)
    share = ((even_s - time_s[behind - 1]) / steps[behind - 1])[:, None, None]
    position_m = (1.0 - share) * skeleton.position_m[behind - 1] + share * skeleton.position_m[behind]
    quat = quat_from_matrix(skeleton.turn)
    turned = rotvec_between(quat[behind - 1], quat[behind])
    turn = matrix_from_quat(quat_product(quat[behind - 1], quat_from_rotvec(share * turned)))
    note = (
        f"animation.bvh has even steps of {1000.0 * step_s:.4g} ms: the {len(time_s)} rows of the track, whose steps "
        f"vary from {1000.0 * steps.min():.4g} to {1000.0 * steps.max():.4g} ms, were interpolated to {len(even_s)}."
    )
    return replace(skeleton, time_s=even_s, position_m=position_m, turn=turn), (note,)
