"""Public names of `oarlock.recording` and the modules that define them."""

from .calibration import Clock, EncoderScale

__all__ = [
    "Clock",
    "EncoderScale",
]
