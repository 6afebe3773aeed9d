"""Splits a model into limbs: one sub-model for each and one for the shared joints. For `track_independent_chains`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

SHARED = "shared"


@dataclass(frozen=True, eq=False)
class Limb:
    """A part of a tree that is tracked separately.

    Args:
        name: name of its first own joint, or `shared`.
        model: the sub-model: its own joints, those below it down to the root, and their sensors.
        own: the joints that this part contributes to the whole track, in the order of the model.
    """

    name: str
    model: Model
    own: tuple[str, ...]


def cut_into_limbs(model: Model, closures: bool = True) -> tuple[Limb, ...]:
    """The part that the limbs share, if there is one, and each limb.

    A joint is shared if two or more of the branches that it moves have inertial units. These branches are the limbs. A
    closure, and the joints at its other end, belong to the limb that alone moves it. A closure between two limbs
    belongs to neither and is dropped.

    Args:
        model: the whole.
        closures: False drops them all.

    Raises:
        DataError: the tree has fewer than two limbs.
    """
    tree = _JointTree(model)
    roots = tree.limb_roots()
    if len(roots) < 2:
        raise DataError(
            f'model "{model.name}": its inertial units are on {"one chain" if roots else "no joint"}, so there '
            "are no limbs to split it into. Use ukf, which tracks the whole body."
        )
    limbs = [_limb(model, tree, root, closures) for root in roots]
    covered = {joint for limb in limbs for joint in limb.own}
    shared = tuple(j for j in tree.order if tree.is_shared(j))
    rest = tuple(j for j in tree.order if j not in covered)
    if not shared:
        return tuple(limbs)
    # joints that belong to no limb and move with the shared part
    kept = {j for j in rest if set(tree.down(j)) <= set(rest) and set(tree.down(j)) & set(shared)}
    return (Limb(SHARED, sub_model(model, kept, set()), tuple(j for j in rest if j in kept)), *limbs)


def _limb(model: Model, tree: _JointTree, root: str, closures: bool) -> Limb:
    own = tree.above(root)
    kept = own | set(tree.down(root))
    bound: set[str] = set()
    others = set(tree.limb_roots()) - {root}
    for closure in model.describe().closures if closures else ():
        ends = [tree.joints_under(frame) for frame in (closure.frame_a, closure.frame_b)]
        if any(own & set(end) for end in ends) and not any(others & set(end) for end in ends):
            bound.add(closure.name)
            kept |= set(ends[0]) | set(ends[1])
    answers = own | {j for j in kept if not tree.is_shared(j) and not tree.carries_unit(j)}
    return Limb(root, sub_model(model, kept, bound), tuple(j for j in tree.order if j in answers))


def sub_model(model: Model, joints: set[str], closures: set[str]) -> Model:
    """The model with only some joints and closures: frames that other joints move are removed with their sensors.

    The rest predicts the same measurements as the whole model, because it does not depend on the removed part.
    """
    return model.without(
        joints=[name for name in model.joint_names if name not in joints],
        closures=[name for name in model.closure_names if name not in closures],
    )


class _JointTree:
    """Parent joint of each joint, and the joints that move inertial units."""

    def __init__(self, model: Model) -> None:
        described = model.describe()
        self.order = tuple(model.joint_names)
        self._frames = {f.name: f for f in described.frames}
        self._below: dict[str, tuple[str, ...]] = {}
        for frame in described.frames:
            joint = frame.joint
            if joint is not None and joint not in self._below:
                self._below[joint] = self.joints_under(frame.name)[1:]
        self._unit_chains = [self.joints_under(s.frame) for s in described.inertial_units]

    def joints_under(self, frame: str) -> tuple[str, ...]:
        """Joints from a frame down to the root, nearest first."""
        found = []
        at: str | None = frame
        while at is not None:
            if (joint := self._frames[at].joint) is not None:
                found.append(joint)
            at = self._frames[at].parent
        return tuple(found)

    def down(self, joint: str) -> tuple[str, ...]:
        """A joint and all joints between it and the root."""
        return (joint, *self._below.get(joint, ()))

    def above(self, joint: str) -> set[str]:
        """A joint and all joints that it moves."""
        return {j for j in self.order if joint in self.down(j)}

    def carries_unit(self, joint: str) -> bool:
        """Whether the joint moves an inertial unit."""
        return any(joint in chain for chain in self._unit_chains)

    def _branches(self, joint: str | None) -> list[str]:
        """Direct child joints of a joint, or of the root, that move units."""
        right_on = [j for j in self.order if (self.down(j)[1:2] or (None,))[0] == joint]
        return [j for j in right_on if self.carries_unit(j)]

    def is_shared(self, joint: str) -> bool:
        """Whether the joint, or a joint that it moves, has two branches with units."""
        return any(len(self._branches(j)) > 1 for j in self.above(joint))

    def limb_roots(self) -> list[str]:
        """The first joint of each limb, in the order of the model."""
        return [
            j
            for j in self.order
            if self.carries_unit(j)
            and not self.is_shared(j)
            and all(self.is_shared(other) for other in self.down(j)[1:])
        ]
