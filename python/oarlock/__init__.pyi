"""The public names of Oarlock and the modules that define them."""

from ._core import Belief, Config, Info, Model, Sample, Tracker, __version__
from .calibration.clocks.calibrate import calibrate_clocks
from .calibration.motion.calibrate import calibrate_motion
from .calibration.session.plan import SessionPlan, SessionStep, default_plan, load_session_plan
from .calibration.session.search import calibrate_session
from .calibration.static.hinge_axes import calibrate_hinge_axes
from .calibration.static.hinge_chain import calibrate_hinge_chain
from .calibration.static.joint_centers import calibrate_joint_centers
from .calibration.static.local_field import calibrate_field
from .calibration.static.pose_mounts import calibrate_pose
from .calibration.static.sagittal import calibrate_sagittal
from .evaluation.comparison.comparison import Comparison, compare
from .evaluation.comparison.limb_track import track_limbs
from .evaluation.comparison.orientation_track import track_orientations
from .evaluation.evaluate import evaluate
from .evaluation.frames import evaluate_frame_orientations
from .evaluation.marker_errors import evaluate_markers
from .evaluation.marker_scores import MarkerEvaluation, PointScore
from .evaluation.markers.arm import Arm
from .evaluation.markers.attachments import (
    Attachment,
    attach_markers,
    load_attachments,
    save_attachments,
)
from .evaluation.markers.body_fit import fit_body
from .evaluation.markers.gaps import fill_gaps
from .evaluation.markers.inverse_kinematics import inverse_kinematics
from .evaluation.markers.low_pass import low_pass
from .evaluation.markers.simulated import simulate_from_markers
from .evaluation.markers.trajectories import Markers
from .evaluation.orientations import evaluate_orientations
from .evaluation.scores import Evaluation
from .evaluation.study.keys import StudyKey
from .evaluation.study.result import StudyResult
from .evaluation.study.spec import Study
from .evaluation.study.study import study
from .evaluation.study.study_file import load_study
from .evaluation.study.sweeps import FaultSweep
from .evaluation.study.trial import StudySimulator, StudyTrial
from .evaluation.suspects.suspect import Suspect
from .evaluation.suspects.suspects import suspects
from .formats.contents import find_recordings, import_recording
from .formats.export.export import Export, export
from .formats.marker_files import load_markers
from .model.ball_joint import with_ball_joint
from .model.description import (
    BaseAccelerationDescription,
    ClosureDescription,
    ConeDescription,
    ContactDescription,
    EncoderDescription,
    FrameDescription,
    ImuDescription,
    JointDescription,
    ModelDescription,
    MountDescription,
    OrientationDescription,
    ParameterDescription,
    PositionDescription,
    ProcessDescription,
    RangeDescription,
    SensorDescription,
    TransformDescription,
    WorldDescription,
)
from .model.joint_play import with_play
from .model.load import Base, load_model
from .model.shapes import Look, Shape, Strand, Viewpoint
from .recording.calibration import Calibration, Clock, EncoderScale, load_calibration
from .recording.recording import Recording, load_recording
from .recording.streams import ImuStream, OrientationStream, ScalarStream, VectorStream
from .simulation.motion import Motion
from .simulation.session import SessionErrors, SessionTrial, simulate_session
from .simulation.simulate import simulate
from .storage.errors import DataError, DivergedError, ModelError, OarlockError
from .tracking.joint_angles import JointAngle, joint_angles
from .tracking.joint_series import BallSeries, FreeSeries, HingeSeries, JointSeries, SlideSeries
from .tracking.many import track_many
from .tracking.track import Track, load_track, track_of_beliefs
from .tracking.tracking import smooth, track

__all__ = [
    "Arm",
    "Attachment",
    "BallSeries",
    "Base",
    "BaseAccelerationDescription",
    "Belief",
    "Calibration",
    "Clock",
    "ClosureDescription",
    "Comparison",
    "ConeDescription",
    "Config",
    "ContactDescription",
    "DataError",
    "DivergedError",
    "EncoderDescription",
    "EncoderScale",
    "Evaluation",
    "Export",
    "FaultSweep",
    "FrameDescription",
    "FreeSeries",
    "HingeSeries",
    "ImuDescription",
    "ImuStream",
    "Info",
    "JointAngle",
    "JointDescription",
    "JointSeries",
    "Look",
    "MarkerEvaluation",
    "Markers",
    "Model",
    "ModelDescription",
    "ModelError",
    "Motion",
    "MountDescription",
    "OarlockError",
    "OrientationDescription",
    "OrientationStream",
    "ParameterDescription",
    "PointScore",
    "PositionDescription",
    "ProcessDescription",
    "RangeDescription",
    "Recording",
    "Sample",
    "ScalarStream",
    "SensorDescription",
    "SessionErrors",
    "SessionPlan",
    "SessionStep",
    "SessionTrial",
    "Shape",
    "SlideSeries",
    "Strand",
    "Study",
    "StudyKey",
    "StudyResult",
    "StudySimulator",
    "StudyTrial",
    "Suspect",
    "Track",
    "Tracker",
    "TransformDescription",
    "VectorStream",
    "Viewpoint",
    "WorldDescription",
    "__version__",
    "attach_markers",
    "calibrate_clocks",
    "calibrate_field",
    "calibrate_hinge_axes",
    "calibrate_hinge_chain",
    "calibrate_joint_centers",
    "calibrate_motion",
    "calibrate_pose",
    "calibrate_sagittal",
    "calibrate_session",
    "compare",
    "default_plan",
    "evaluate",
    "evaluate_frame_orientations",
    "evaluate_markers",
    "evaluate_orientations",
    "export",
    "fill_gaps",
    "find_recordings",
    "fit_body",
    "import_recording",
    "inverse_kinematics",
    "joint_angles",
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
    "track_of_beliefs",
    "track_orientations",
    "with_ball_joint",
    "with_play",
]
