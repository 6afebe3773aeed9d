"""Angles of ball and free joints under their names, estimate by estimate, for the live page and the other outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.angle_sequence import angle_labels, angles_from_quat, angles_near
from oarlock.model.coordinates import joint_columns
from oarlock.model.rotation import quat_from_rotvec, quat_product, wrap
from oarlock.storage.arrays import Floats
from oarlock.tracking.joint_angles import NamedRotation, named_rotation

if TYPE_CHECKING:
    from oarlock._core import Model

_STEP_RAD = 1e-5
_TURNED = quat_from_rotvec(_STEP_RAD * np.concatenate([np.zeros((1, 3)), np.eye(3)]))
"""As it is, and turned a little about each of the child's axes."""
_SEQUENCE = "YXY"


@dataclass
class _Joint:
    named: NamedRotation
    columns: list[int]
    last_rad: Floats | None = None


@dataclass
class LiveAngles:
    """The angles of `oarlock.joint_angles` of ball and free joints; balls with other names by the model's sequence.

    An estimate's angles are those nearest to the last one's, so that curves have no jumps.

    Args:
        model: of the body.
    """

    model: Model
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        self._joints = list(_joints(self.model))
        self.names = tuple(name for joint in self._joints for name in joint.named.names)

    def of(self, mean: Floats, std: Floats) -> tuple[Floats, Floats]:
        """Angles and their standard deviations, rad, of coordinates and theirs; NaN where these are."""
        rows = [_angles(joint, mean[joint.columns], std[joint.columns]) for joint in self._joints]
        both = np.concatenate([np.empty((2, 0)), *rows], axis=1)
        return both[0], both[1]


def joints_with_names(model: Model) -> dict[str, NamedRotation]:
    """Each ball and free joint of a model with its names."""
    found = {}
    for joint in model.describe().joints:
        if joint.kind in ("ball", "free"):
            named = named_rotation(joint.name, joint.kind == "free")
            found[joint.name] = named or _by_letters(joint.name, joint.angles or _SEQUENCE)
    return found


def _by_letters(joint: str, sequence: str) -> NamedRotation:
    return NamedRotation(sequence, tuple(f"{joint}_angle_{letter}" for letter in angle_labels(sequence)))


def _joints(model: Model) -> Iterator[_Joint]:
    columns = joint_columns(model.coordinate_names)
    for joint, named in joints_with_names(model).items():
        yield _Joint(named, list(columns[joint][-3:]))


def _angles(joint: _Joint, rotvec_rad: Floats, std_rad: Floats) -> Floats:
    """(2, k): the angles of one joint, and their standard deviations."""
    named, is_bend = joint.named, len(joint.named.names) == 1
    if not np.isfinite(rotvec_rad).all():
        return np.full((2, len(named.names)), np.nan)
    # Differences in place of `angle_stds`, which takes ten times as long for a single row.
    quat = named.rotation(quat_product(quat_from_rotvec(rotvec_rad[None]), _TURNED))
    if joint.last_rad is None or is_bend:
        joint.last_rad = _first(quat[:1], named)
    angles = angles_near(quat, named.sequence, joint.last_rad)
    joint.last_rad = angles[:1]
    stds = np.linalg.norm(wrap(angles[1:] - angles[0]) / _STEP_RAD * std_rad[:, None], axis=0)
    if is_bend:
        return np.array([angles[0, 1:2], stds[1:2]])
    return np.array([np.multiply(named.signs, angles[0]) + named.offsets_rad, stds])


def _first(quat: Floats, named: NamedRotation) -> Floats:
    """The triple whose named angles are within half a turn of 0."""
    angles = angles_from_quat(quat, named.sequence)
    meant = np.multiply(named.signs, angles) + named.offsets_rad
    return angles + np.multiply(named.signs, wrap(meant) - meant)
