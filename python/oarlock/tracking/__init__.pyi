"""Public names of `oarlock.tracking` and the modules that define them."""

from .joint_series import BallSeries, FreeSeries, HingeSeries, JointSeries, SlideSeries
from .track import track_of_beliefs

__all__ = [
    "BallSeries",
    "FreeSeries",
    "HingeSeries",
    "JointSeries",
    "SlideSeries",
    "track_of_beliefs",
]
