"""`with_ball_joint`: two hinges of a body, such as those of an elbow, become one ball; for `oarlock track --ball`.

Used where nothing determines how the units are rotated about their segments. The axes of the hinges are then unknown
in the units' axes, and a model with hinges would force wrong axes on the readings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from oarlock.model.edit import Document, Table, document_of, model_of
from oarlock.model.part import without_unused_parameters
from oarlock.model.rotation import quat_from_matrix, rotvec_from_quat
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.model.description import JointDescription

START_STD_RAD = float(np.radians(20.0))
"""How far relative orientations in the first posture are from the rest posture, about each axis."""


def ball_name(upper: str, lower: str) -> str:
    """`elbow_r` of `elbow_flexion_r` and `elbow_pronation_r`."""
    one, two = upper.split("_"), lower.split("_")
    side = one[-1:] if one[-1] == two[-1] in ("r", "l") else []
    return "_".join([one[0], *side]) if one[0] == two[0] else f"{upper}_{lower}"


def with_ball_joint(model: Model, upper: str, lower: str) -> Model:
    """The body with a ball in place of two hinges at one point.

    The ball starts within 20 deg about each axis of the hinges' rest posture. It swings as far as the first hinge
    bends. The rotation about the second hinge's axis is not limited, because its zero is unknown.

    Args:
        model: with both hinges.
        upper: the hinge nearer to the root.
        lower: the other one; it moves a frame at the first one's own.

    Raises:
        DataError: a name is no hinge that moves one frame, or the two are not at one point.
    """
    document = document_of(model)
    first, second = (_moved_frame(model, document, name) for name in (upper, lower))
    frames = {frame.name: frame for frame in model.describe().frames}
    ahead, behind = frames[first["name"]].before, frames[second["name"]].before
    assert ahead is not None and behind is not None, "frames with a transform have a pose in their parent"
    users = [t for t in document["frame"] if t["parent"] == first["name"]]
    seated = [t for t in document.get("sensor", ()) if t.get("frame") == first["name"]]
    if (
        users != [second]
        or seated
        or np.any(np.asarray(ahead.rotation) != np.eye(3))
        or np.any(behind.translation)
    ):
        raise DataError(f'ball: "{lower}" does not follow "{upper}" directly and at the same point')
    told = {joint.name: joint for joint in model.describe().joints}
    joint = _ball(model, told[upper], second, str(first["parent"]))
    moved = {
        "name": second["name"],
        "parent": first["parent"],
        "transform": first["transform"],
        "joint": joint["name"],
    }
    places = {second["name"]: moved}
    document["frame"] = [places.get(t["name"], t) for t in document["frame"] if t["name"] != first["name"]]
    document["joint"] = [joint if t["name"] == lower else t for t in document["joint"] if t["name"] != upper]
    return model_of(without_unused_parameters(document), model)


def _moved_frame(model: Model, document: Document, joint: str) -> Table:
    kinds = {table["name"]: table["kind"] for table in document.get("joint", ())}
    frames = [table for table in document["frame"] if table.get("joint") == joint]
    if kinds.get(joint) != "hinge" or len(frames) != 1 or "transform" not in frames[0]:
        raise DataError(f'ball: "{joint}" is no hinge of the model "{model.name}" that moves one frame')
    (frame,) = frames
    return dict(frame)


def _ball(model: Model, upper: JointDescription, second: Table, parent: str) -> Document:
    rest = np.concatenate([np.ravel(joint.rest) for joint in model.describe().joints])
    poses = model.forward_kinematics(rest)
    above, below = (poses[model.frame_names.index(name), :3, :3] for name in (parent, second["name"]))
    axis = str(second.get("axis", "z")).lstrip("-")
    assert upper.process is not None, "hinges move"
    return {
        "name": ball_name(upper.name, str(second["joint"])),
        "kind": "ball",
        "label": f"{upper.name} and {second['joint']} as one ball: their axes are unknown",
        "angles": "YXY",
        "rest": rotvec_from_quat(quat_from_matrix(above.T @ below)).tolist(),
        "limits": {"axis": axis, "swing": float(np.abs(upper.limits).max())},
        "process": {"start_std": [START_STD_RAD, *upper.process.start_std[1:]]},
    }
