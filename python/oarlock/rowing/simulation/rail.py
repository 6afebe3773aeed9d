"""Adds the slope of the seat's rail to a model as a state, for rigs whose slope was not measured.

The models carry the slope as the parameter `rail_slope_rad`, positive rising toward the feet. The trunk's angle counts
from the boat's upright, whatever the rail does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from oarlock.model.edit import document_of, merged, model_of, moving_frame
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock import Model

RAIL_JOINT = "rail_slope"
SHOULDERS = ("r_shoulder", "l_shoulder")

_JOINT = {
    "name": RAIL_JOINT,
    "kind": "hinge",
    "label": "seat's rail beyond rail_slope_rad, positive rising toward the feet (stern)",
    "limits": ["-3*pi/180", "3*pi/180"],
    "process": {"kind": "walk", "density": 1e-4, "start_std": [0.025]},
}
_SLOPE = "rail_slope_rad"


def on_unknown_rail(model: Model) -> Model:
    """The model with the joint `rail_slope`, a constant that tracking finds; itself if it has one.

    Args:
        model: `sculler`, `sculler_boat`, `ergometer` or a copy whose frame `seat` is written as theirs.

    Raises:
        DataError: the model's seat does not slide on a rail of slope `rail_slope_rad`.
    """
    if RAIL_JOINT in model.joint_names:
        return model
    document = document_of(model)
    frames = {table["name"]: table for table in document.get("frame", ())}
    seat = frames.get("seat", {})
    shoulders = [name for name in SHOULDERS if frames.get(name, {}).get("parent") == "seat"]
    if _SLOPE not in seat.get("transform", {}).get("rpy", ()) or len(shoulders) != len(SHOULDERS):
        raise DataError(
            f"model '{model.name}': its seat does not slide along rail_slope_rad with both shoulders on it; "
            "start from a copy of `sculler`"
        )
    rail = moving_frame("rail", seat["parent"], "-x", RAIL_JOINT)
    # rotated back, so that the trunk's angle is relative to the boat
    hips = moving_frame("hips", "seat", "z", RAIL_JOINT, sign=-1)
    seat["parent"] = "rail"
    for name in shoulders:
        frames[name]["parent"] = "hips"
    # A constant that moves several frames is a state of the tree alone.
    changes = {"structure": "tree", "joint": [_JOINT], "frame": [rail, hips]}
    return model_of(merged(document, changes), model)
