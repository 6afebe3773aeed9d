"""Monte-Carlo studies over sensors, noise, mounts, rates and settings; comparisons of estimators."""

from oarlock.evaluation.comparison.comparison import Comparison, compare
from oarlock.evaluation.comparison.limb_track import track_independent_chains
from oarlock.evaluation.comparison.orientation_track import track_orientations
from oarlock.evaluation.study.keys import StudyKey
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import Study
from oarlock.evaluation.study.study import run_study
from oarlock.evaluation.study.study_file import load_study
from oarlock.evaluation.study.sweeps import FaultSweep
from oarlock.evaluation.study.trial import StudySimulator, StudyTrial

__all__ = [
    "Comparison",
    "FaultSweep",
    "Study",
    "StudyKey",
    "StudyResult",
    "StudySimulator",
    "StudyTrial",
    "compare",
    "load_study",
    "run_study",
    "track_independent_chains",
    "track_orientations",
]
