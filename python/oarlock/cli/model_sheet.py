"""Prints a model for `oarlock model show`: parameters, joints, frames, sensors, closures, layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from oarlock.cli.terminal import heading, number, say, table
from oarlock.evaluation.scores import presentation
from oarlock.model.angle_sequence import angle_labels
from oarlock.model.description import (
    ConeDescription,
    ImuDescription,
    JointDescription,
    ModelDescription,
    OrientationDescription,
    RangeDescription,
    SensorDescription,
)
from oarlock.model.edit import document_of
from oarlock.model.layout import blocks, parts_of, quantities, rows_of
from oarlock.report.pose_picture.skeleton import StickFigure, views

if TYPE_CHECKING:
    from oarlock import Model

_SI = {"hinge": "rad", "slide": "m"}


def write(model: ModelDescription) -> None:
    """Prints everything but the pose."""
    say(model.name, style="bold")
    for line in (model.description, model.path):
        if line:
            say(line, style="dim" if line == model.path else "")
    _parameters(model)
    _joints(model)
    _frames(model)
    _sensors(model)
    _closures(model)
    _base_accelerations(model)
    _layout(model)


def write_pose(body: StickFigure, given: Sequence[str]) -> None:
    """Prints where the frames are in a pose; frames at one point have one row."""
    heading("Pose", ", ".join(["at rest", *given, "--svg FILE draws it"]))
    side, front = views(body)
    factor, unit = presentation("m")
    points = [(spot.name, *side.project(spot.point), front.project(spot.point)[0]) for spot in body.spots]
    table(
        ["frame", f">forward {unit}", f">up {unit}", f">left {unit}"],
        [(name, *(number(value * factor, ".0f") for value in place)) for name, *place in points],
    )


def checked(loaded: Model) -> list[str]:
    """What was checked in a model file without mistakes, one sentence each, and how it is tracked."""
    model = loaded.describe()
    inputs = sum(joint.input for joint in model.joints)
    return [
        f"{len(model.parameters)} parameters; every expression uses names that exist",
        f"{len(model.frames) - 1} frames; every parent exists, no cycle, every joint is known",
        f"{len(model.joints)} joints, {inputs} of them inputs{_counted(model)}; kinds, limits, processes are valid",
        f"{len(model.sensors)} sensors; each sits on a frame or joint that exists and has its noise",
        f"{len(model.closures)} closures; points and axes are complete",
        f"state {len(model.state_names)} rows, measurement {len(model.measurement_names)} rows",
        _structure(loaded),
    ]


def _structure(model: Model) -> str:
    """How a model is tracked, and whether its file chooses that."""
    document = document_of(model)
    joints = document.get("links", {}).get("joints", "hand_rig")
    text, other = "tracked as a tree", "strapdown"
    if model.structure == "strapdown":
        text, other = f'tracked as strapdown links, joints = "{joints}"', "tree"
    is_chosen = "structure" in document
    return text if is_chosen else f'{text}, by default; structure = "{other}" in the file changes it'


def _counted(model: ModelDescription) -> str:
    """Return the number of coordinates as text if it differs from the number of joints."""
    count = sum(len(joint.coordinates) for joint in model.joints)
    return f", {count} coordinates" if count > len(model.joints) else ""


def _parameters(model: ModelDescription) -> None:
    if not model.parameters:
        return
    heading("Parameters", "change one with --set NAME=VALUE")
    table(
        ["name", ">value", "unit", ">std", "what it is"],
        [
            (
                p.name,
                number(p.value, ".4f"),
                p.unit,
                number(p.std, ".4f", ""),
                p.label,
            )
            for p in model.parameters
        ],
    )


def _joints(model: ModelDescription) -> None:
    heading("Joints", "limits are soft; process noise density per sqrt(s)")
    table(
        ["joint", "kind", ">from", ">to", ">rest", "unit", "moves as", "state"],
        [_joint_row(joint, model.state_names) for joint in model.joints],
    )
    _cones(model)
    _coordinates(model)
    labelled = [joint for joint in model.joints if joint.label]
    if labelled:
        heading("Descriptions of the joints")
        table(["joint", "what it is"], [(joint.name, joint.label) for joint in labelled])


def _joint_row(joint: JointDescription, state_names: Sequence[str]) -> tuple[str, ...]:
    shown = [_in_unit(value, joint.kind) for value in (*joint.limits, joint.rest)]
    process = joint.process
    motion = "input" if joint.input else f"{process.kind} {process.density:g}" if process else ""
    rows = _joint_states(joint.name, state_names)
    unit = {"slide": "m", "fixed": "m", "free": "m, deg"}.get(joint.kind, presentation("rad")[1])
    return (joint.name, joint.kind, *shown, unit, motion, rows)


def _cones(model: ModelDescription) -> None:
    coned = [(joint.name, joint.cone) for joint in model.joints if joint.cone is not None]
    if coned:
        factor, unit = presentation("rad")
        heading("Ranges of balls", "from rest: twist about an axis of the child, then a swing of this axis")
        table(
            ["joint", "axis", ">swing", ">twist from", ">to", "unit"],
            [
                (name, cone.axis, _swing(cone), *(number(v * factor, ".0f") for v in cone.twist), unit)
                for name, cone in coned
            ],
        )


def _swing(cone: ConeDescription) -> str:
    """The largest swing; two if they differ, with the axes about which they are."""
    first, second = (number(angle * presentation("rad")[0], ".0f") for angle in cone.swing)
    a, b = (axis for axis in "xyz" if axis != cone.axis)
    return first if cone.swing[0] == cone.swing[1] else f"{first} about {a}, {second} about {b}"


def _in_unit(value: float | Sequence[float], kind: str) -> str:
    """A limit or rest posture as text; a free joint lists the position before the rotation vector."""
    numbers = [value] if isinstance(value, int | float) else list(value)
    lengths = len(numbers) if kind in ("slide", "fixed") else 3 if len(numbers) == 6 else 0
    factor = presentation("rad")[0]
    return " ".join(
        [number(v, ".2f") for v in numbers[:lengths]] + [number(v * factor, ".0f") for v in numbers[lengths:]]
    )


def _coordinates(model: ModelDescription) -> None:
    several = [(joint, joint.angles) for joint in model.joints if joint.angles is not None]
    if not several:
        return
    heading("Joints with several coordinates", "rx, ry, rz: rotation vector of parent-from-child, rad")
    table(
        ["joint", "coordinates", "named angles", "rotates about"],
        [
            (
                joint.name,
                ", ".join(_short(joint)),
                angles,
                ", ".join(angle_labels(angles)),
            )
            for joint, angles in several
        ],
    )


def _short(joint: JointDescription) -> list[str]:
    """The first name in full; only the differing part of the others."""
    first, *others = joint.coordinates
    return [first, *(name.removeprefix(joint.name) for name in others)]


def _joint_states(name: str, state_names: Sequence[str]) -> str:
    # A sensor may have the name of the joint; its biases are separate rows.
    return rows_of(name, ["" if "_bias_" in row else row for row in state_names])


def _frames(model: ModelDescription) -> None:
    heading("Frames", "the sign is that of the joint's motion")
    worn: dict[str, list[str]] = {}
    for sensor in model.sensors:
        worn.setdefault(sensor.frame or "", []).append(sensor.name)
    table(
        [">#", "frame", "parent", "moved by", "carries"],
        [
            (
                index,
                frame.name,
                frame.parent or "",
                "" if not frame.joint else f"{'-' if frame.sign < 0 else '+'} {frame.joint}",
                ", ".join(worn.get(frame.name, [])),
            )
            for index, frame in enumerate(model.frames)
        ],
    )


def _sensors(model: ModelDescription) -> None:
    heading("Sensors", "noise as standard deviations")
    table(
        [
            "sensor",
            "kind",
            "on",
            ">gyro rad/s",
            ">accel m/s2",
            ">mag uT",
            ">reading",
            "rows",
            "biases in state",
        ],
        [_sensor_row(sensor, model) for sensor in model.sensors],
    )


def _sensor_row(sensor: SensorDescription, model: ModelDescription) -> tuple[str, ...]:
    reading = next((f"{std:g} {unit}".strip() for std, unit in _stds(sensor, model) if std is not None), "")
    noise: tuple[float | None, ...] = (None, None, None)
    if isinstance(sensor, ImuDescription):
        noise = (sensor.gyro_std_rad_s, sensor.accel_std_m_s2, sensor.mag_std_ut)
    ends = f"{sensor.frame_a}, {sensor.frame_b}" if isinstance(sensor, RangeDescription) else ""
    rows = rows_of(sensor.name, model.measurement_names)
    return (
        sensor.name,
        sensor.kind,
        sensor.frame or sensor.joint or ends,
        *(number(std, form, "") for std, form in zip(noise, (".5f", ".5f", ".3f"), strict=True)),
        reading,
        rows or ("input" if sensor.joint in {joint.name for joint in model.inputs} else ""),
        rows_of(
            sensor.name,
            [row if "_bias_" in row or "_error_" in row else "" for row in model.state_names],
        ),
    )


def _stds(sensor: SensorDescription, model: ModelDescription) -> list[tuple[float | None, str]]:
    """Standard deviations of a reading that is one quantity, with their units."""
    kind = next((joint.kind for joint in model.joints if joint.name == sensor.joint), "")
    turn = sensor.std_rad if isinstance(sensor, OrientationDescription) else None
    return [(sensor.std, _SI.get(kind, "")), (sensor.std_m, "m"), (turn, "rad")]


def _closures(model: ModelDescription) -> None:
    if not model.closures:
        return
    heading("Closures", "two points (and two axes, if given) that must agree")
    factor, unit = presentation("m")
    table(
        ["closure", "joins", "with", f">std {unit}", ">std axis", "constrains", "rows"],
        [
            (
                c.name,
                c.frame_a,
                c.frame_b,
                number(c.std_m * factor, "g"),
                number(c.std_axis, "g", ""),
                quantities(parts_of(c.name, model.measurement_names)),
                rows_of(c.name, model.measurement_names),
            )
            for c in model.closures
        ],
    )


def _base_accelerations(model: ModelDescription) -> None:
    if not model.base_acceleration:
        return
    heading("Base accelerations", "estimated, not measured")
    table(
        ["name", "axis", ">density", "state", "what it is"],
        [
            (
                b.name,
                " ".join(f"{x:g}" for x in b.axis),
                f"{b.density:g}",
                rows_of(b.name, model.state_names),
                b.label,
            )
            for b in model.base_acceleration
        ],
    )


def _layout(model: ModelDescription) -> None:
    joints = {joint.name: "joints" for joint in model.joints}
    sensors = {sensor.name: f"{sensor.kind} sensors" for sensor in model.sensors}
    closures = {closure.name: "closures" for closure in model.closures}
    for title, names, kinds in (
        ("State", model.state_names, joints),
        ("Measurement", model.measurement_names, sensors | closures),
    ):
        heading(title, f"{len(names)} rows")
        table(["rows", ">count", "contents"], [(b.rows, b.count, b.kind) for b in blocks(names, kinds)])
