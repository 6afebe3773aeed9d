"""Oarlock tracks articulated bodies from wearable and mounted sensors, and says how sure it is.

Everything that is meant to be used is named here; `oarlock.rowing` adds one field of use.
"""

from oarlock._core import Belief, Config, Info, Model, Sample, Tracker, __version__
from oarlock.calibration import Calibration, Clock, EncoderScale, load_calibration
from oarlock.clocks import calibrate_clocks
from oarlock.compare import Comparison, compare, track_limbs, track_orientations
from oarlock.errors import DataError, DivergedError, ModelError
from oarlock.evaluate import Evaluation, evaluate
from oarlock.evaluate.frames import evaluate_frame_orientations
from oarlock.evaluate.marker_scores import MarkerEvaluation, PointScore
from oarlock.evaluate.markers import evaluate_markers
from oarlock.evaluate.orientations import evaluate_orientations
from oarlock.export import Export, export
from oarlock.hinge_axes import calibrate_hinge_axes
from oarlock.hinge_chain import calibrate_hinge_chain
from oarlock.joint_centers import calibrate_joint_centers
from oarlock.local_field import calibrate_field
from oarlock.markers import (
    Arm,
    Attachment,
    Markers,
    attach_markers,
    fill_gaps,
    fit_body,
    inverse_kinematics,
    load_attachments,
    load_markers,
    low_pass,
    save_attachments,
    simulate_from_markers,
)
from oarlock.models import Base, load_model
from oarlock.motion import Motion
from oarlock.motion_calibration import calibrate_motion
from oarlock.parallel_tracking import track_many
from oarlock.pose_mounts import calibrate_pose
from oarlock.recording import (
    ImuStream,
    OrientationStream,
    Recording,
    ScalarStream,
    VectorStream,
    load_recording,
)
from oarlock.session import SessionPlan, SessionStep, calibrate_session, default_plan, load_session_plan
from oarlock.session_simulation import SessionErrors, SessionTrial, simulate_session
from oarlock.shapes import Look, Shape, Strand, Viewpoint
from oarlock.simulate import simulate
from oarlock.study import (
    FaultSweep,
    Study,
    StudyKey,
    StudyResult,
    StudySimulator,
    StudyTrial,
    load_study,
    study,
)
from oarlock.suspects import Suspect, suspects
from oarlock.track import Track, load_track
from oarlock.tracking import smooth, track

__all__ = [
    "Arm",
    "Attachment",
    "Base",
    "Belief",
    "Calibration",
    "Clock",
    "Comparison",
    "Config",
    "DataError",
    "DivergedError",
    "EncoderScale",
    "Evaluation",
    "Export",
    "FaultSweep",
    "ImuStream",
    "Info",
    "Look",
    "MarkerEvaluation",
    "Markers",
    "Model",
    "ModelError",
    "Motion",
    "OrientationStream",
    "PointScore",
    "Recording",
    "Sample",
    "ScalarStream",
    "SessionErrors",
    "SessionPlan",
    "SessionStep",
    "SessionTrial",
    "Shape",
    "Strand",
    "Study",
    "StudyKey",
    "StudyResult",
    "StudySimulator",
    "StudyTrial",
    "Suspect",
    "Track",
    "Tracker",
    "VectorStream",
    "Viewpoint",
    "__version__",
    "attach_markers",
    "calibrate_clocks",
    "calibrate_field",
    "calibrate_hinge_axes",
    "calibrate_hinge_chain",
    "calibrate_joint_centers",
    "calibrate_motion",
    "calibrate_pose",
    "calibrate_session",
    "compare",
    "default_plan",
    "evaluate",
    "evaluate_frame_orientations",
    "evaluate_markers",
    "evaluate_orientations",
    "export",
    "fill_gaps",
    "fit_body",
    "inverse_kinematics",
    "load_attachments",
    "load_calibration",
    "load_markers",
    "load_model",
    "load_recording",
    "load_session_plan",
    "load_study",
    "load_track",
    "low_pass",
    "save_attachments",
    "simulate",
    "simulate_from_markers",
    "simulate_session",
    "smooth",
    "study",
    "suspects",
    "track",
    "track_limbs",
    "track_many",
    "track_orientations",
]


def _config_from_dict(keys: dict[str, object]) -> Config:
    """Unpickles a Config."""
    return Config(**keys)
