"""Positions and axes of the hinges of a chain in a posture, computed from the poses of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from oarlock.model.description import ModelDescription
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model


@dataclass(frozen=True, eq=False)
class HingeLink:
    """One sensor's link in a posture, and the hinge that moves it.

    Args:
        sensor: the sensor's name.
        joint: the hinge's name.
        world_from_link: (3, 3), of the frame that carries the sensor; world is the root frame.
        origin_in_world: (3,) that frame's origin, m.
        axis_in_world: (3,) unit vector; a positive joint angle turns the link about it by the right hand.
        hinge_in_world: (3,) the point of the axis nearest to the frame's origin, m.
    """

    sensor: str
    joint: str
    world_from_link: Floats
    origin_in_world: Floats
    axis_in_world: Floats
    hinge_in_world: Floats

    @property
    def axis_in_link(self) -> Floats:
        """(3,) unit vector, fixed in the link."""
        return np.asarray(self.world_from_link.T @ self.axis_in_world)


def hinge_links(model: Model, sensors: Sequence[str], q: Floats) -> tuple[HingeLink, ...]:
    """The links of a chain from base to tip, one sensor each, at values of the coordinates q (n_coordinates,).

    Raises:
        DataError: the sensors are no chain: two on one link, a hinge without a sensor between them, a joint that is
            no hinge, or sensors on different branches.
    """
    described = model.describe()
    frame_of = {s.name: s.frame for s in described.inertial_units}
    for name in sensors:
        if name not in frame_of:
            raise DataError(
                f'hinge chain: the model "{model.name}" has no inertial unit "{name}". '
                f"{did_you_mean(name, frame_of)}"
            )
    paths = {name: joints_above(described, frame_of[name]) for name in sensors}
    ordered = sorted(sensors, key=lambda name: len(paths[name]))
    _check_chain(described, ordered, paths)
    return tuple(_link(model, name, frame_of[name], paths[name][-1], q) for name in ordered)


def posture(model: Model, rest_q: Mapping[str, float] | ArrayLike | None) -> Floats:
    """Values of the coordinates (n_coordinates,), rad or m: a mapping by name (others 0), an array, or None (all 0).

    Raises:
        DataError: another shape, no finite number, or a joint that the model does not have.
    """
    names = list(model.coordinate_names)
    if not isinstance(rest_q, Mapping):
        given: ArrayLike = np.zeros(len(names)) if rest_q is None else rest_q
    else:
        for name in rest_q:
            if name not in names:
                raise DataError(
                    f'rest_q: the model "{model.name}" has no joint "{name}". {did_you_mean(name, names)}'
                )
        given = [real_array(rest_q.get(name, 0.0), (), f'rest_q of "{name}"').item() for name in names]
    q = real_array(given, (len(names),), "rest_q")
    if not np.isfinite(q).all():
        raise DataError(f"rest_q: is {q.tolist()}; expected finite numbers in rad (hinges) and m (slides)")
    return q


def joints_above(described: ModelDescription, frame: str) -> list[str]:
    """The joints that move a frame, from the root to it; a joint that moves several frames comes as often."""
    frames = {f.name: f for f in described.frames}
    fixed = {j.name for j in described.joints if j.kind == "fixed"}
    found: list[str] = []
    here: str | None = frame
    while here is not None:
        joint = frames[here].joint
        if joint is not None and joint not in fixed:
            found.insert(0, joint)
        here = frames[here].parent
    return found


def _check_chain(
    described: ModelDescription, ordered: Sequence[str], paths: Mapping[str, Sequence[str]]
) -> None:
    kinds = {j.name: j.kind for j in described.joints}
    before, carried = "the root", list[str]()
    for name in ordered:
        path = list(paths[name])
        where = f'hinge chain: sensor "{name}"'
        if path == carried:
            raise DataError(
                f"{where} moves with {before}: each needs a hinge of its own. Name the sensors to use."
            )
        if path[: len(carried)] != carried:
            raise DataError(
                f"{where} is moved by {', '.join(path) or 'nothing'}, {before} by {', '.join(carried)}: "
                "they are on different branches. Name the sensors of one chain."
            )
        own = path[len(carried) :]
        other = [j for j in own if kinds[j] != "hinge"]
        if other:
            raise DataError(
                f'{where}: the joint "{other[0]}" that moves it is a {kinds[other[0]]}, no hinge.'
            )
        if len(own) > 1:
            raise DataError(
                f"{where}: {len(own)} hinges lie between {before} and it ({', '.join(own)}), and one can be told "
                "from one sensor. Find its mount by hand, or put a sensor on every link."
            )
        before, carried = f'"{name}"', path


def _link(model: Model, sensor: str, frame: str, joint: str, q: Floats) -> HingeLink:
    at, k = model.frame_names.index(frame), model.coordinate_names.index(joint)
    # Finite turns give axis and centre without the error of a difference.
    turns = np.tile(q, (3, 1))
    turns[1:, k] += (0.5 * np.pi, np.pi)
    rest, quarter, half = model.forward_kinematics(turns)[:, at]
    turned = quarter[:3, :3] @ rest[:3, :3].T
    axis = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    return HingeLink(
        sensor=sensor,
        joint=joint,
        world_from_link=rest[:3, :3],
        origin_in_world=rest[:3, 3],
        axis_in_world=axis / np.linalg.norm(axis),
        hinge_in_world=0.5 * (rest[:3, 3] + half[:3, 3]),
    )
