"""The joint that a scalar stream of a model reads, for units and ranges of its values."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.model.description import JointDescription


def joint_read(model: Model, stream: str) -> JointDescription | None:
    """The joint of an encoder or of an input; None for other streams."""
    told = model.describe()
    name = next((sensor.joint for sensor in told.sensors if sensor.name == stream), stream)
    return next((joint for joint in told.joints if joint.name == name), None)


def unit_read(model: Model, stream: str) -> str:
    """The unit of a scalar stream: "rad" for an angle, else "m"."""
    joint = joint_read(model, stream)
    return "rad" if joint is not None and joint.kind != "slide" else "m"
