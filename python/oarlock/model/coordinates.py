"""Names, units and arithmetic of coordinates: `trunk`; `shoulder.rx`, `.ry`, `.rz`; `pelvis.x` to `pelvis.rz`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from oarlock.model.description import JointDescription
from oarlock.model.rotation import quat_from_rotvec, quat_product, rotvec_from_quat
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

POSITION = ("x", "y", "z")
ROTATION = ("rx", "ry", "rz")

Kind = Literal["scalar", "rotation", "position"]


@dataclass(frozen=True)
class JointPart:
    """What of a joint is one thing: a hinge's or slide's value, a rotation, a position.

    Args:
        name: the joint's, or of a free joint `pelvis.position` and `pelvis.rotation`.
        joint: the joint's name.
        kind: what the columns hold: one value, a rotation vector or a position.
        columns: of the joint's coordinates, one or three.
        labels: short name of each column within the part: "" of a scalar, else x, y, z or rx, ry, rz.
    """

    name: str
    joint: str
    kind: Kind
    columns: tuple[int, ...]
    labels: tuple[str, ...] = ("",)


def joint_columns(coordinate_names: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Columns of each joint, one, three (ball) or six (free), joints in the order of their first column.

    Raises:
        DataError: some coordinates of a ball or free joint are missing.
    """
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(coordinate_names):
        joint, label = _split(name)
        found.setdefault(joint, {})[label] = column
    return {joint: _in_order(joint, columns) for joint, columns in found.items()}


def parts(coordinate_names: Sequence[str]) -> tuple[JointPart, ...]:
    """The parts of all joints: one of a hinge, a slide and a ball, position and rotation of a free joint."""
    found: list[JointPart] = []
    for joint, columns in joint_columns(coordinate_names).items():
        if len(columns) == 1:
            found.append(JointPart(joint, joint, "scalar", columns))
        elif len(columns) == 3:
            found.append(JointPart(joint, joint, "rotation", columns, ROTATION))
        else:
            found.append(JointPart(f"{joint}.position", joint, "position", columns[:3], POSITION))
            found.append(JointPart(f"{joint}.rotation", joint, "rotation", columns[3:], ROTATION))
    return tuple(found)


def rotation_columns(coordinate_names: Sequence[str]) -> list[list[int]]:
    """Columns of each rotation vector."""
    return [list(part.columns) for part in parts(coordinate_names) if part.kind == "rotation"]


def with_untold_at_zero(q: Floats) -> Floats:
    """Coordinates (T, n) in which those that no stream ever told, NaN from first to last, stand at 0."""
    return np.where(np.isnan(q).all(axis=0), 0.0, q)


def plus(q: Floats, step: Floats, rotations: Sequence[list[int]]) -> Floats:
    """Coordinates (T, n) after small steps (T, n): values add, a rotation R becomes R Exp(e), e in the child's axes."""
    moved = np.asarray(q + step)
    for columns in rotations:
        turned = quat_product(quat_from_rotvec(q[:, columns]), quat_from_rotvec(step[:, columns]))
        moved[:, columns] = rotvec_from_quat(turned)
    return moved


Joints = Sequence[JointDescription]


def coordinate_units(model: Model, joints: Joints | None = None) -> tuple[str, ...]:
    """Unit of each coordinate: "m" of slides and of free joints' x, y, z, "rad" of the rest.

    `joints` are those of `model.describe()`, where they are at hand.
    """
    slides = {joint.name for joint in _joints(model, joints) if joint.kind == "slide"}
    in_m = [name in slides or _split(name)[1] in POSITION for name in model.coordinate_names]
    return tuple("m" if length else "rad" for length in in_m)


def joint_units(model: Model, joints: Joints | None = None) -> tuple[str, ...]:
    """Unit of each joint: "m" for slides, "m, rad" for free joints, "rad" for the rest."""
    special = {"slide": "m", "free": "m, rad"}
    return tuple(special.get(joint.kind, "rad") for joint in _joints(model, joints))


def angle_sequences(model: Model, joints: Joints | None = None) -> Mapping[str, str]:
    """The model's angle sequence of each ball and free joint."""
    return {joint.name: joint.angles for joint in _joints(model, joints) if joint.angles is not None}


def _joints(model: Model, joints: Joints | None) -> Joints:
    return model.describe().joints if joints is None else joints


def _split(name: str) -> tuple[str, str]:
    joint, _, label = name.rpartition(".")
    return (joint, label) if joint and label in POSITION + ROTATION else (name, "")


def _in_order(joint: str, columns: Mapping[str, int]) -> tuple[int, ...]:
    for wanted in (("",), ROTATION, POSITION + ROTATION):
        if set(columns) == set(wanted):
            return tuple(columns[label] for label in wanted)
    have = ", ".join(f"{joint}.{label}" if label else joint for label in columns)
    raise DataError(
        f'joint "{joint}": there are {have}; a ball joint has {joint}.rx, .ry and .rz, a free joint '
        f"{joint}.x, .y and .z besides. Give all of them, once each."
    )
