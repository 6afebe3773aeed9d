"""Public names of `oarlock.model` and the modules that define them."""

from .ball_joint import with_ball_joint
from .description import (
    BaseAccelerationDescription,
    ClosureDescription,
    ConeDescription,
    ContactDescription,
    EncoderDescription,
    FrameDescription,
    ImuDescription,
    JointDescription,
    ModelDescription,
    MountDescription,
    OrientationDescription,
    ParameterDescription,
    PositionDescription,
    ProcessDescription,
    RangeDescription,
    SensorDescription,
    TransformDescription,
    WorldDescription,
)
from .joint_play import with_play
from .load import Base
from .shapes import Look, Shape, Strand, Viewpoint

__all__ = [
    "Base",
    "BaseAccelerationDescription",
    "ClosureDescription",
    "ConeDescription",
    "ContactDescription",
    "EncoderDescription",
    "FrameDescription",
    "ImuDescription",
    "JointDescription",
    "Look",
    "ModelDescription",
    "MountDescription",
    "OrientationDescription",
    "ParameterDescription",
    "PositionDescription",
    "ProcessDescription",
    "RangeDescription",
    "SensorDescription",
    "Shape",
    "Strand",
    "TransformDescription",
    "Viewpoint",
    "WorldDescription",
    "with_ball_joint",
    "with_play",
]
