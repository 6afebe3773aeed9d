"""`SessionPlan` and `SessionStep`: the steps of a guided session, their postures, joints and times; plan files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sized
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.session import step_values as values
from oarlock.calibration.session.still_pose import STANDING, StillPose, belongs, chosen_pose, still_poses
from oarlock.model.shipped_files import model_folder
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

FORMAT = 1
WHOLE_BODY = "full_body"
"""The shipped body whose plan serves its parts."""
KINDS = ("still", "turn", "pose", "move", "mark", "sign")
POSTURE_STD_RAD = float(np.radians(3.0))
"""How well a person who was shown a posture takes it up, each direction."""

_CHECKS: dict[str, Callable[[object, str], object]] = {
    "kind": values.text,
    "start_s": values.finite,
    "end_s": values.finite,
    "pose": values.posture,
    "joints": values.names,
    "units": values.names,
    "axis": values.axis,
    "first": values.one_way,
    "stream": values.text,
    "value": values.finite,
    "other": values.text,
    "sign": values.one_way,
    "posture_std_rad": values.posture_std,
    "optional": values.yes_or_no,
    "say": values.text,
}
_MAY_BE_NONE = ("start_s", "end_s", "axis", "posture_std_rad")


@dataclass(frozen=True)
class SessionStep:
    """One step of a session.

    Args:
        name: as people call it.
        kind: `still` (units lie still, anyhow), `turn` (units are laid on their sides one after the other), `pose` (the
            body holds a known posture), `move` (the body turns about one joint), `mark` (a scalar stream is held at
            a known value), `sign` (two scalar streams rise together, or against each other).
        start_s: when it begins, s of the recording; None: found by itself, which `mark` and `sign` cannot.
        end_s: when it ends, s.
        pose: the posture held, or that in which a movement begins, by coordinate (rad, m); the others as at rest.
        joints: of a `move`: the joints that turn, at the same time, one for each side.
        units: of a `move`: further units beyond these joints that turn with them as one rigid body, such as those of a
            straight arm.
        axis: (3,) of a `move` of ball joints: the axis, in the axes of the joint's parent.
        first: of a `move`: 1 if the first clear turn is positive, -1 if negative.
        stream: of a `mark` or `sign`: the scalar stream.
        value: of a `mark`: what it should read, rad or m.
        other: of a `sign`: the stream that it is held against.
        sign: of a `sign`: 1 if both rise together, -1 if one falls as the other rises.
        posture_std_rad: how well the posture is taken up, rad; None: the plan's.
        optional: whether the session is complete without it.
        say: what to tell the person.

    Raises:
        DataError: a value that does not fit the kind.
    """

    name: str
    kind: str
    start_s: float | None = None
    end_s: float | None = None
    pose: Mapping[str, float] = field(default_factory=dict)
    joints: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    axis: tuple[float, float, float] | None = None
    first: int = 1
    stream: str = ""
    value: float = 0.0
    other: str = ""
    sign: int = 1
    posture_std_rad: float | None = None
    optional: bool = False
    say: str = ""

    def __post_init__(self) -> None:
        where = f'plan, step "{values.text(self.name, "plan, name of a step")}"'
        for name, check in _CHECKS.items():
            if (given := getattr(self, name)) is not None or name not in _MAY_BE_NONE:
                object.__setattr__(self, name, check(given, f"{where}: {name}"))
        object.__setattr__(self, "pose", MappingProxyType(dict(self.pose)))
        if self.kind not in KINDS:
            raise DataError(f"{where}: kind = {self.kind!r}. {did_you_mean(self.kind, KINDS)}")
        if (self.start_s is None) != (self.end_s is None):
            raise DataError(f"{where}: give both start_s and end_s, or neither")
        if self.start_s is not None and self.end_s is not None and not self.start_s < self.end_s:
            raise DataError(f"{where}: lasts from {self.start_s} to {self.end_s} s; the end must be later")
        if self.kind == "move" and not self.joints:
            raise DataError(f'{where}: a move needs joints, such as joints = ["elbow_flexion"]')
        if self.kind in ("mark", "sign") and not self.stream:
            raise DataError(f"{where}: a {self.kind} needs stream, the name of a scalar stream")
        if self.kind == "mark" and self.start_s is None:
            raise DataError(f"{where}: a mark needs start_s and end_s: nothing in the data shows where it is")
        if self.kind == "sign" and not self.other:
            raise DataError(f"{where}: a sign needs other, the stream that it is held against")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        values = (getattr(self, f.name) for f in fields(self))
        return SessionStep, tuple(dict(v) if isinstance(v, Mapping) else v for v in values)

    @property
    def span_s(self) -> tuple[float, float] | None:
        """(start, end) in s where both are given."""
        return None if self.start_s is None or self.end_s is None else (self.start_s, self.end_s)


@dataclass(frozen=True)
class SessionPlan:
    """The steps of a session in the order in which they are done.

    Args:
        name: of the protocol.
        steps: its steps.
        posture_std_rad: how well postures are taken up, rad, each direction.
        any_order: whether the steps may be done in any order; they are told apart by the units that move.
    """

    name: str
    steps: tuple[SessionStep, ...]
    posture_std_rad: float = POSTURE_STD_RAD
    any_order: bool = False

    def __post_init__(self) -> None:
        where = f'plan "{values.text(self.name, "plan, name")}"'
        given: object = self.steps
        steps = tuple(given) if isinstance(given, Iterable) else (given,)
        if not all(isinstance(step, SessionStep) for step in steps):
            raise DataError(f"{where}: steps are oarlock.calibration.SessionStep(...), one after the other")
        object.__setattr__(self, "steps", steps)
        if not self.steps:
            raise DataError(f"{where}: has no steps")
        std_rad = values.posture_std(self.posture_std_rad, f"{where}: posture_std_rad")
        object.__setattr__(self, "posture_std_rad", std_rad)
        object.__setattr__(self, "any_order", values.yes_or_no(self.any_order, f"{where}: any_order"))

    def check(self, model: Model) -> None:
        """Refuse names that the model does not have.

        Raises:
            DataError: a joint or coordinate of no such name; it names the nearest.
        """
        joints = {j.name: j.kind for j in model.describe().joints}
        for step in self.steps:
            where = f'plan, step "{step.name}"'
            for name in step.pose:
                if name not in model.coordinate_names:
                    hint = did_you_mean(name, model.coordinate_names)
                    raise DataError(f'{where}: the model "{model.name}" has no coordinate "{name}". {hint}')
            for name in step.joints:
                if name not in joints:
                    hint = did_you_mean(name, tuple(joints))
                    raise DataError(f'{where}: the model "{model.name}" has no joint "{name}". {hint}')
                if joints[name] in ("ball", "free") and step.axis is None:
                    raise DataError(
                        f'{where}: "{name}" is a {joints[name]} joint; say about which axis it turns'
                    )
                if joints[name] not in ("ball", "free", "hinge"):
                    raise DataError(f'{where}: "{name}" is a {joints[name]} joint and does not turn')

    def save(self, file: str | PathLike[str]) -> None:
        """Write as TOML; `load_session_plan` reads it back."""
        from oarlock.storage.write_file import write_file

        write_file(Path(file), plan_text(self))


def plan_text(plan: SessionPlan) -> str:
    """The text of a plan's file."""
    from oarlock.storage.toml import toml_text

    return toml_text(
        {
            "format": FORMAT,
            "name": plan.name,
            "posture_std_rad": plan.posture_std_rad,
            "any_order": plan.any_order,
            "step": [_told(step) for step in plan.steps],
        }
    )


def load_session_plan(file: str | PathLike[str], pose: str = STANDING) -> SessionPlan:
    """Read a plan.

    Args:
        file: a plan file.
        pose: the still pose of the session; a plan offers those of its tables [[posture]].

    Raises:
        DataError: the file cannot be read, a key is unknown, a step does not make sense, or the plan has no such pose;
            with file and line.
    """
    from oarlock.storage.toml import TomlTable

    top = TomlTable.read(Path(file))
    top.check_format(FORMAT)
    top.check_keys({"format", "name", "posture_std_rad", "any_order", "posture", "step"})
    still = chosen_pose(still_poses(top), pose, f"plan {file}")
    known = {f.name for f in fields(SessionStep)}
    steps = []
    for table in top.tables("step"):
        table.check_keys(known | {"poses"})
        table.string("name")
        table.string("kind")
        keys: dict[str, Any] = dict(table.values)
        try:
            poses = values.names(keys.pop("poses", ()), "poses")
            if still.taken_in(table.string("kind")):
                keys.setdefault("pose", still.pose)
            step = SessionStep(**keys)
        except DataError as error:
            raise DataError(f"{table.where()}: {error}") from None
        if belongs(poses, still):
            steps.append(step)
    name = top.string("name", Path(file).stem) + ("" if still.name == STANDING else f", pose {still.name}")
    posture_std_rad = top.number("posture_std_rad", POSTURE_STD_RAD)
    return SessionPlan(name, tuple(steps), posture_std_rad, top.boolean("any_order", False))


def default_plan(model: Model, pose: str = STANDING) -> SessionPlan:
    """The protocol that ships with a model or with the body that it is a part of, or a plain one: turn each hinge.

    Args:
        model: a body.
        pose: the still pose; bodies of persons have `N` (standing, arms hanging), `T` (arms level) and `sitting`.

    Raises:
        DataError: the protocol has no such pose.
    """
    folder = model_folder() / "plans"
    shipped = folder / f"{model.name}.toml"
    if shipped.is_file():
        return fitted(load_session_plan(shipped, pose), model)
    body = fitted(load_session_plan(folder / f"{WHOLE_BODY}.toml", pose), model)
    if any(step.kind == "move" for step in body.steps):
        return replace(body, name=f"{model.name}: {body.name}")
    chosen_pose({STANDING: StillPose(STANDING)}, pose, f'the plan of the model "{model.name}"')
    hinges = [j.name for j in model.describe().joints if j.kind == "hinge" and not j.input]
    moves = [SessionStep(f"turn {name}", "move", joints=(name,)) for name in hinges]
    rest = [SessionStep(f"rest posture {k}", "pose") for k in range(len(moves) + 1)]
    paired = [step for both in zip(rest, [*moves, rest[-1]], strict=True) for step in both][:-1]
    return SessionPlan(f"{model.name}, hinge by hinge", tuple(paired))


def fitted(plan: SessionPlan, model: Model) -> SessionPlan:
    """A plan without joints, units and coordinates that a model does not have, and without movements of none."""
    described = model.describe()
    joints, units = {j.name for j in described.joints}, {s.name for s in described.inertial_units}
    coordinates = set(model.coordinate_names)
    steps = []
    for step in plan.steps:
        kept = tuple(name for name in step.joints if name in joints)
        if step.kind == "move" and not kept:
            continue
        pose = {name: value for name, value in step.pose.items() if name in coordinates}
        steps.append(
            replace(step, joints=kept, units=tuple(name for name in step.units if name in units), pose=pose)
        )
    return replace(plan, steps=tuple(steps))


def _told(step: SessionStep) -> dict[str, object]:
    """The keys of a step that are not as by default."""
    table: dict[str, object] = {}
    for f in fields(SessionStep):
        value = getattr(step, f.name)
        empty = value is None or (isinstance(value, Sized) and not value)
        if f.name in ("name", "kind") or not (empty or value == f.default):
            table[f.name] = dict(value) if isinstance(value, Mapping) else value
    return table
