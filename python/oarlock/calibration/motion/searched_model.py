"""Extends a model for `calibrate_motion`: sensor positions and encoder zeros as states, a rocking root, other noise.

It is tracked as a tree, whose states these constants can be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from oarlock._core import Model
from oarlock.calibration.motion.hypothesis import (
    HINGE_ZERO_STD_RAD,
    MOUNT_STD_RAD,
    PLACE_STD_M,
    SLIDE_ZERO_STD_M,
    Hypothesis,
)
from oarlock.model.edit import document_of
from oarlock.recording.calibration import Calibration
from oarlock.storage.toml import toml_text

Document = dict[str, Any]

PLACE, ZERO, ROCK = "search_place", "search_zero", "search_rock"
CONSTANT_WALK = 1e-7
"""A state that does not change may not have a density of zero."""

# Of a vehicle that floats: limits, then density, time and start of an acceleration that dies away.
_SLIDES = (
    ("sideways", [-0.1, 0.1], 3.0, 0.2, [0.02, 0.1, 0.5]),
    ("upwards", [-0.04, 0.04], 1.5, 0.2, [0.01, 0.05, 0.3]),
)
_TURNS = (("yaw", math.pi), ("pitch", math.radians(5.0)), ("roll", math.radians(8.0)))
_TURN = (2.0, 0.5, [0.05, 0.2, 1.0])
_PUSH = {"density": 1.0, "start_std": 0.3, "time_s": 0.3, "always": True}


def searched_model(
    model: Model,
    known: Calibration,
    hypothesis: Hypothesis,
    *,
    azimuth_rad: float | None,
    zeros_of: Iterable[str] = (),
    constants: bool = True,
) -> Model:
    """The model under a hypothesis, with all constants of the wearing as parameters or states.

    Args:
        model: as the user has it.
        known: values to start from, with their standard deviations where it has them.
        hypothesis: noise, weights, and what the root does.
        azimuth_rad: of the magnetic field, for a root that yaws; None without magnetometers.
        zeros_of: encoders whose zeros are sought.
        constants: False leaves out places and zeros: a model to judge a calibration by.
    """
    document: Document = document_of(model)
    document["structure"] = "tree"
    weight = 1.0 / math.sqrt(hypothesis.samples_per_error)
    _set_parameters(document, model, known, weight)
    _set_noise(document, hypothesis)
    if constants:
        _set_mounts(document, known, weight)
        _add_zeros(document, set(zeros_of), weight)
    if moves_its_root(document):
        if hypothesis.rocks:
            _add_rocking(document, model, azimuth_rad)
        else:
            _add_pushes(document, model)
    return Model.from_toml(toml_text(document), model.path, {})


def moves_its_root(document: Document) -> bool:
    """Whether something accelerates the root, and no joint of the model says yet how it rocks."""
    first = [frame for frame in document["frame"] if frame["parent"] == "root"]
    carried = len(first) == 1 and "joint" in first[0]
    return bool(document.get("base_acceleration")) and not carried


def _set_parameters(document: Document, model: Model, known: Calibration, weight: float) -> None:
    parameters = document.setdefault("parameters", {})
    values = model.parameters | dict(known.parameters)
    for name, entry in parameters.items():
        table = entry if isinstance(entry, dict) else {"default": entry}
        std = known.parameter_stds.get(name, table.get("std"))
        parameters[name] = table | {"default": values[name]} | ({"std": std * weight} if std else {})


def _set_noise(document: Document, hypothesis: Hypothesis) -> None:
    added = (
        ("gyro_std_rad_s", hypothesis.gyro_rad_s),
        ("accel_std_m_s2", hypothesis.accel_m_s2),
        ("mag_std_ut", hypothesis.mag_ut),
        ("std_m", hypothesis.loop_m),
        ("std_axis", hypothesis.loop_axis),
    )
    units = [s for s in document.get("sensor", []) if s["kind"] == "imu"]
    for table in [*units, *document.get("closure", [])]:
        for key, std in added:
            if key in table and std:
                table[key] = math.hypot(table[key], std)


def _set_mounts(document: Document, known: Calibration, weight: float) -> None:
    for unit in (s for s in document["sensor"] if s["kind"] == "imu"):
        name, mount = unit["name"], unit.setdefault("mount", {})
        offset = mount.get("offset", [0, 0, 0])
        if name in known.mounts:
            rotation, place = known.mounts[name]
            mount.pop("rpy", None)
            mount["rotation"], offset = rotation.tolist(), place.tolist()
        mount["std_rad"] = weight * largest(known.mount_stds_rad.get(name), MOUNT_STD_RAD)
        stds = known.mount_offset_stds_m.get(name, np.full(3, PLACE_STD_M))
        mount["offset"] = []
        for axis, place, std in zip("xyz", offset, stds, strict=True):
            parameter = f"{PLACE}_{name}_{axis}"
            document["parameters"][parameter] = {"default": 0.0, "unit": "m", "std": max(std, 1e-4) * weight}
            mount["offset"].append(f"{_expression(place)} + {parameter}")


def largest(stds: Any, otherwise: float) -> float:
    """The largest of three standard deviations, or what holds where none are known."""
    return otherwise if stds is None else max(float(np.max(stds)), 1e-4)


def _expression(value: object) -> str:
    return f"({value})" if isinstance(value, str) else f"({float(value):.12f})"  # type: ignore[arg-type]


def _add_zeros(document: Document, encoders: set[str], weight: float) -> None:
    """A constant turn or shift along with each joint that an encoder reads."""
    joints = {joint["name"]: joint for joint in document["joint"]}
    for sensor in [s for s in document["sensor"] if s["kind"] == "encoder" and s["name"] in encoders]:
        moved = joints[sensor["joint"]]
        std = weight * (HINGE_ZERO_STD_RAD if moved["kind"] == "hinge" else SLIDE_ZERO_STD_M)
        name = f"{ZERO}_{sensor['name']}"
        process = {"kind": "walk", "density": CONSTANT_WALK, "start_std": [std]}
        document["joint"].append(
            {"name": name, "kind": moved["kind"], "limits": [-2.0 * std, 2.0 * std], "process": process}
        )
        for frame in [f for f in document["frame"] if f.get("joint") == moved["name"]]:
            document["frame"].append(_behind(frame, name))


def _behind(frame: Document, joint: str) -> Document:
    """A frame between this one and its parent, moved by another joint about the same axis."""
    still = {"translation": [0, 0, 0]}
    between = {"name": f"{frame['name']}_{ZERO}", "parent": frame["parent"], "joint": joint}
    between |= {key: frame[key] for key in ("sign", "axis") if key in frame}
    between["transform"] = frame.get("transform", still)
    if "transform" in frame:
        frame["transform"] = still
    frame["parent"] = between["name"]
    return between


def _add_pushes(document: Document, model: Model) -> None:
    up, forward = _directions(model)
    for name, axis in (("sideways", np.cross(up, forward)), ("upwards", up)):
        document["base_acceleration"].append({"name": f"{ROCK}_{name}", "axis": axis.tolist()} | _PUSH)


def _add_rocking(document: Document, model: Model, azimuth_rad: float | None) -> None:
    """Joints between the root and all that hangs on it."""
    up, forward = _directions(model)
    left = np.cross(up, forward)
    axes = {"sideways": left, "upwards": up, "yaw": up, "pitch": left, "roll": forward}
    turns = _TURNS if azimuth_rad is not None else _TURNS[1:]
    joints = [(name, "slide", limits, process) for name, limits, *process in _SLIDES]
    joints += [(name, "hinge", [-limit, limit], list(_TURN)) for name, limit in turns]
    if azimuth_rad is not None:
        document["world"] |= {"azimuth_fixed": True, "magnetic_azimuth_rad": azimuth_rad}
    for frame in document["frame"]:
        if frame["parent"] == "root":
            frame["parent"] = f"{ROCK}_{joints[-1][0]}"
    parent = "root"
    for name, kind, limits, (density, time_s, start_std) in joints:
        process = {"kind": "singer", "time_s": time_s, "density": density, "start_std": start_std}
        own = {"name": f"{ROCK}_{name}"}
        document["joint"].append(own | {"kind": kind, "limits": limits, "process": process})
        moved = {"parent": parent, "transform": {"translation": [0, 0, 0]}, "axis": axes[name].tolist()}
        document["frame"].append(own | moved | {"joint": own["name"]})
        parent = own["name"]


def _directions(model: Model) -> tuple[Any, Any]:
    world = model.describe().world
    return np.asarray(world.up, dtype=float), np.asarray(world.forward, dtype=float)
