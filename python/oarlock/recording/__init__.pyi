"""Public names of `oarlock.recording` and the modules that define them."""

from .calibration import Clock, EncoderScale
from .streams import ImuStream, OrientationStream, ScalarStream, VectorStream

__all__ = [
    "Clock",
    "EncoderScale",
    "ImuStream",
    "OrientationStream",
    "ScalarStream",
    "VectorStream",
]
