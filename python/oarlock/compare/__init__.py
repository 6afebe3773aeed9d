"""Estimators of the literature on the same recording: whole trees, limbs, single units with inverse kinematics."""

from oarlock.compare.comparison import Comparison, compare
from oarlock.compare.estimators import Estimator, estimator, estimators, usual_estimators
from oarlock.compare.limb_track import track_limbs
from oarlock.compare.limbs import Limb, cut_into_limbs
from oarlock.compare.orientation_track import ORIENTATION_FILTERS, track_orientations
from oarlock.compare.scores import Score

__all__ = [
    "ORIENTATION_FILTERS",
    "Comparison",
    "Estimator",
    "Limb",
    "Score",
    "compare",
    "cut_into_limbs",
    "estimator",
    "estimators",
    "track_limbs",
    "track_orientations",
    "usual_estimators",
]
