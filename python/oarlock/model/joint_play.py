"""`with_play`: hinges that also turn a little across their axis, as `calibrate axes` finds; `track --play` uses it."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.model.edit import Document, document_of, model_of
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

PER_S = 10.0
"""Play is crossed within about a tenth of a second: rate and acceleration at the start, relative to the angle."""


def with_play(model: Model, std_rad: Mapping[str, float]) -> Model:
    """The body with hinges that turn a little about the two directions across their axis as well (docs/mounts.md).

    Two hinges ``NAME_play_1`` and ``NAME_play_2`` precede each, with the process noise of the joint itself. Frames keep
    their names, so a calibration of the model without play serves too.

    Args:
        model: with hinges.
        std_rad: name of a hinge -> standard deviation of its rotation about each direction across the axis, rad.

    Raises:
        DataError: the model has no such hinge, it moves several frames, is an input or has play already, or a standard
            deviation is not positive.
    """
    # Only in a tree are these hinges states, with the standard deviation of the play at the start.
    document = {**document_of(model), "structure": "tree"}
    possible = hinges_that_can_have_play(model)
    for name, std in std_rad.items():
        if not 0.0 < std < inf:
            raise DataError(
                f'play of "{name}": a standard deviation of {std:g} rad ({degrees(std):g} deg); expected more than 0, '
                "e.g. 0.05 rad (3 deg)"
            )
        if name not in possible:
            raise DataError(f"{_why_not(document, name)}. {did_you_mean(name, possible)}")
        start_std = next(j.process.start_std for j in model.describe().joints if j.name == name and j.process)
        _loosen(document, name, [float(std) * PER_S**k for k in range(len(start_std))])
    return model_of(document, model)


def hinges_that_can_have_play(model: Model) -> list[str]:
    """Names of the hinges that `with_play` takes: no inputs, none that moves several frames, none with play."""
    document = document_of(model)
    return [joint["name"] for joint in document["joint"] if not _why_not(document, joint["name"])]


def _why_not(document: Document, name: str) -> str:
    """Why a joint cannot have play; empty if it can."""
    hinges = {j["name"]: j for j in document["joint"] if j.get("kind") == "hinge"}
    if name not in hinges:
        return f'there is no hinge "{name}"'
    if hinges[name].get("input", False):
        return f'hinge "{name}" is an input, which cannot have play'
    if f"{name}_play_1" in hinges:
        return f'hinge "{name}" has play already'
    moved = sum(frame.get("joint") == name for frame in document["frame"])
    return "" if moved == 1 else f'"{name}" moves {moved} frames; play is possible in a hinge that moves one'


def _loosen(document: Document, name: str, start_std: list[float]) -> None:
    """Puts the two hinges and their frames before those of the joint."""
    joints, frames = document["joint"], document["frame"]
    hinge = next(joint for joint in joints if joint["name"] == name)
    frame = next(frame for frame in frames if frame.get("joint") == name)
    loose = [f"{name}_play_{k}" for k in (1, 2)]
    first: Document = {"name": loose[0], "parent": frame["parent"], "transform": {"translation": [0, 0, 0]}}
    if "transform" in frame:
        # The joint acts behind the transform; in a Denavit-Hartenberg row before it, about z of the parent.
        first["transform"], frame["transform"] = frame["transform"], {"translation": [0, 0, 0]}
    second = {"name": loose[1], "parent": loose[0], "transform": {"translation": [0, 0, 0]}}
    frame["parent"] = loose[1]
    process = {**hinge.get("process", {}), "start_std": start_std}
    for own, joint, axis in zip((first, second), loose, _across(frame.get("axis", "z")), strict=True):
        own |= {"axis": axis, "joint": joint}
        limits = [-2.0 * start_std[0], 2.0 * start_std[0]]
        joints.insert(
            joints.index(hinge), {"name": joint, "kind": "hinge", "limits": limits, "process": process}
        )
        frames.insert(frames.index(frame), own)


def _across(axis: Any) -> list[list[float]]:
    """Two unit vectors normal to an axis and to each other."""
    along = (
        np.eye(3)["xyz".index(axis.lstrip("-"))] if isinstance(axis, str) else np.asarray(axis, dtype=float)
    )
    return [row.tolist() for row in np.linalg.svd(along[None, :])[2][1:]]
