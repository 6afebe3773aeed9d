"""Oarlock tracks articulated bodies from wearable and mounted sensors, and says how sure it is.

Everything that is meant to be used is named here; `oarlock.rowing` adds one field of use.
"""

from oarlock._core import Belief, Config, Info, Model, Sample, Tracker, __version__
from oarlock.calibration import Calibration, load_calibration
from oarlock.errors import DataError, DivergedError, ModelError
from oarlock.evaluate import Evaluation, evaluate
from oarlock.evaluate.frames import evaluate_frame_orientations
from oarlock.evaluate.orientations import evaluate_orientations
from oarlock.hinge_axes import calibrate_hinge_axes
from oarlock.hinge_chain import calibrate_hinge_chain
from oarlock.joint_centers import calibrate_joint_centers
from oarlock.local_field import calibrate_field
from oarlock.models import Base, load_model
from oarlock.motion import Motion
from oarlock.parallel_tracking import track_many
from oarlock.pose_mounts import calibrate_pose
from oarlock.recording import ImuStream, Recording, ScalarStream, VectorStream, load_recording
from oarlock.simulate import simulate
from oarlock.study import Study, StudyKey, StudyResult, StudyTrial, load_study, study
from oarlock.track import Track, load_track
from oarlock.tracking import smooth, track

__all__ = [
    "Base",
    "Belief",
    "Calibration",
    "Config",
    "DataError",
    "DivergedError",
    "Evaluation",
    "ImuStream",
    "Info",
    "Model",
    "ModelError",
    "Motion",
    "Recording",
    "Sample",
    "ScalarStream",
    "Study",
    "StudyKey",
    "StudyResult",
    "StudyTrial",
    "Track",
    "Tracker",
    "VectorStream",
    "__version__",
    "calibrate_field",
    "calibrate_hinge_axes",
    "calibrate_hinge_chain",
    "calibrate_joint_centers",
    "calibrate_pose",
    "evaluate",
    "evaluate_frame_orientations",
    "evaluate_orientations",
    "load_calibration",
    "load_model",
    "load_recording",
    "load_study",
    "load_track",
    "simulate",
    "smooth",
    "study",
    "track",
    "track_many",
]


def _config_from_dict(keys: dict[str, object]) -> Config:
    """Unpickles a Config."""
    return Config(**keys)
