"""Pairs of neighbouring inertial units and the joint between them, for the searches for axes and joint centres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.chain_geometry import joints_above
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

ROOT = "(root)"
"""Stands for a unit that rests on the root, where the root is at rest."""

POSTURES = 12
EXACT = 1e-9
"""Poses are rounded near 1e-15; a joint that is off by more is another joint."""


@dataclass(frozen=True, eq=False)
class LinkPair:
    """Two units with joints between their frames, and none that carries a third unit.

    Args:
        parent: the unit nearer to the root, or `ROOT`.
        child: the other one.
        joints: the joints between their frames, from parent to child.
        center: (6,) the joint's centre in axes of the parent's frame, then of the child's, m; None where no point is
            fixed in both. Of a hinge it is the point of the axis nearest to the child frame's origin.
        axis: (6,) a hinge's axis in the same two axes, unit vectors of one sense; None for other joints.
        center_by_length: (6, n_lengths) derivatives of the centre by `Model.length_names`; None without a centre.
    """

    parent: str
    child: str
    joints: tuple[str, ...]
    center: Floats | None
    axis: Floats | None
    center_by_length: Floats | None

    @property
    def label(self) -> str:
        """The joints' names in one text."""
        return "+".join(self.joints)

    @property
    def units(self) -> tuple[str, str]:
        """Parent, child."""
        return self.parent, self.child


def link_pairs(
    model: Model, sensors: Sequence[str], search: str, root_at_rest: bool | None = None
) -> tuple[LinkPair, ...]:
    """Each unit with the nearest one below it, in the order of `sensors`.

    Args:
        model: the bodies.
        sensors: inertial units.
        search: for error texts.
        root_at_rest: whether a unit without another below it is paired with the root; None: if the model has
            neither a base acceleration nor a joint that lets the whole body go.

    Raises:
        DataError: two units move with the same joints.
    """
    described = model.describe()
    frame_of = {s.name: s.frame for s in described.inertial_units}
    paths = {name: tuple(joints_above(described, frame_of[name])) for name in sensors}
    for child, path in paths.items():
        twins = [other for other, own in paths.items() if other != child and own == path]
        if twins:
            raise DataError(
                f'{search}: "{child}" and "{twins[0]}" sit on the same body. Name the sensors to use, one a body.'
            )
    if root_at_rest is None:
        free = any(j.kind == "free" for j in described.joints)
        root_at_rest = not free and not described.base_acceleration
    if root_at_rest and () not in paths.values():
        frame_of[ROOT], paths = model.frame_names[0], {ROOT: (), **paths}
    poses, by_length = _poses(model)
    pairs = []
    for child, path in paths.items():
        below = [n for n, own in paths.items() if len(own) < len(path) and path[: len(own)] == own]
        if below:
            parent = max(below, key=lambda name: len(paths[name]))
            frames = [model.frame_names.index(frame_of[name]) for name in (parent, child)]
            geometry = _joint(poses[:, frames], by_length[:, frames])
            pairs.append(LinkPair(parent, child, path[len(paths[parent]) :], *geometry))
    return tuple(pairs)


def _poses(model: Model) -> tuple[Floats, Floats]:
    """(POSTURES, n_frames, 4, 4) in arbitrary postures, always the same, and derivatives of the origins by lengths."""
    described = model.describe()
    slides = {j.name for j in described.joints if j.kind == "slide"}
    # a free joint's positions are as good as its turns
    scale = [0.3 if name in slides else 0.7 for name in model.coordinate_names]
    q = np.random.default_rng(1).standard_normal((POSTURES, len(scale))) * scale
    return np.asarray(model.forward_kinematics(q)), np.asarray(model.frame_jacobian(q).by_length)


def _joint(poses: Floats, by_length: Floats) -> tuple[Floats | None, Floats | None, Floats | None]:
    """Centre and axis of a joint and the centre's derivatives, from two frames' (POSTURES, 2, 4, 4) poses."""
    between = np.linalg.inv(poses[:, 0]) @ poses[:, 1]
    turns, shifts = between[:, :3, :3], between[:, :3, 3]
    # A point fixed in both: the rotation times its place in the child plus the shift is its place in the parent.
    rows = np.concatenate([-np.broadcast_to(np.eye(3), turns.shape), turns], axis=2).reshape(-1, 6)
    _, strengths, directions = np.linalg.svd(rows)
    free = directions[strengths < EXACT * strengths[0]]
    solve = -np.linalg.pinv(rows, rcond=EXACT)
    center = solve @ shifts.reshape(-1)
    apart = float(np.abs(rows @ center + shifts.reshape(-1)).max())
    if len(free) > 1 or apart > EXACT * (1.0 + float(np.abs(shifts).max())):
        return None, None, None
    moves = np.swapaxes(poses[:, 0, :3, :3], 1, 2) @ (by_length[:, 1] - by_length[:, 0])
    center_by_length = solve @ moves.reshape(len(rows), -1)
    if not len(free):
        return center, None, center_by_length
    axis = free[0] * np.sqrt(2.0)
    nearest = np.eye(6) - np.outer(axis, np.r_[np.zeros(3), axis[3:]])
    return nearest @ center, axis, nearest @ center_by_length
