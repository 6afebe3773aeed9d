"""Public names of `oarlock.tracking` and the modules that define them."""

from .joint_series import JointSeries
from .track import track_of_beliefs

__all__ = [
    "JointSeries",
    "track_of_beliefs",
]
