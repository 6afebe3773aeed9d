"""Oarlock tracks articulated bodies from wearable and mounted sensors, and says how sure it is.

Everything that is meant to be used is named here; `oarlock.rowing` adds one field of use.
"""

from oarlock._core import Belief, Config, Info, Model, Sample, Tracker, __version__
from oarlock.calibration.clocks.calibrate import calibrate_clocks
from oarlock.calibration.motion.calibrate import calibrate_motion
from oarlock.calibration.session.plan import SessionPlan, SessionStep, default_plan, load_session_plan
from oarlock.calibration.session.search import calibrate_session
from oarlock.calibration.static.hinge_axes import calibrate_hinge_axes
from oarlock.calibration.static.hinge_chain import calibrate_hinge_chain
from oarlock.calibration.static.joint_centers import calibrate_joint_centers
from oarlock.calibration.static.local_field import calibrate_field
from oarlock.calibration.static.pose_mounts import calibrate_pose
from oarlock.evaluation.comparison.comparison import Comparison, compare
from oarlock.evaluation.comparison.limb_track import track_limbs
from oarlock.evaluation.comparison.orientation_track import track_orientations
from oarlock.evaluation.evaluate import evaluate
from oarlock.evaluation.frames import evaluate_frame_orientations
from oarlock.evaluation.marker_errors import evaluate_markers
from oarlock.evaluation.marker_scores import MarkerEvaluation, PointScore
from oarlock.evaluation.markers.arm import Arm
from oarlock.evaluation.markers.attachments import (
    Attachment,
    attach_markers,
    load_attachments,
    save_attachments,
)
from oarlock.evaluation.markers.body_fit import fit_body
from oarlock.evaluation.markers.gaps import fill_gaps
from oarlock.evaluation.markers.inverse_kinematics import inverse_kinematics
from oarlock.evaluation.markers.low_pass import low_pass
from oarlock.evaluation.markers.simulated import simulate_from_markers
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.evaluation.orientations import evaluate_orientations
from oarlock.evaluation.scores import Evaluation
from oarlock.evaluation.study.keys import StudyKey
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import Study
from oarlock.evaluation.study.study import study
from oarlock.evaluation.study.study_file import load_study
from oarlock.evaluation.study.sweeps import FaultSweep
from oarlock.evaluation.study.trial import StudySimulator, StudyTrial
from oarlock.evaluation.suspects.suspects import Suspect, suspects
from oarlock.formats.export.export import Export, export
from oarlock.formats.marker_files import load_markers
from oarlock.model.load import Base, load_model
from oarlock.model.shapes import Look, Shape, Strand, Viewpoint
from oarlock.recording.calibration import Calibration, Clock, EncoderScale, load_calibration
from oarlock.recording.recording import Recording, load_recording
from oarlock.recording.streams import ImuStream, ScalarStream, VectorStream
from oarlock.simulation.motion import Motion
from oarlock.simulation.session import SessionErrors, SessionTrial, simulate_session
from oarlock.simulation.simulate import simulate
from oarlock.storage.errors import DataError, DivergedError, ModelError
from oarlock.tracking.many import track_many
from oarlock.tracking.track import Track, load_track
from oarlock.tracking.tracking import smooth, track

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
    """Unpickle a Config; in one of 0.1.0 that names the iterated filter, `ekf` takes its place."""
    return Config(**{key: "ekf" if (key, value) == ("filter", "iekf") else value for key, value in keys.items()})
