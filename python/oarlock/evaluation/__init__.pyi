"""Public names of `oarlock.evaluation` and the modules that define them."""

from .frames import evaluate_frame_orientations
from .orientations import evaluate_orientations
from .scores import Evaluation
from .suspects.suspect import Suspect
from .suspects.suspects import find_suspects

__all__ = [
    "Evaluation",
    "Suspect",
    "evaluate_frame_orientations",
    "evaluate_orientations",
    "find_suspects",
]
