"""Public names of `oarlock.calibration` and the modules that define them."""

from .clocks.calibrate import calibrate_clocks
from .motion.calibrate import calibrate_motion
from .session.plan import SessionPlan, SessionStep, default_plan, load_session_plan
from .session.search import calibrate_session
from .static.hinge_axes import calibrate_hinge_axes
from .static.hinge_chain import calibrate_hinge_chain
from .static.joint_centers import calibrate_joint_centers
from .static.local_field import calibrate_field
from .static.pose_mounts import calibrate_pose
from .static.sagittal import calibrate_sagittal

__all__ = [
    "SessionPlan",
    "SessionStep",
    "calibrate_clocks",
    "calibrate_field",
    "calibrate_hinge_axes",
    "calibrate_hinge_chain",
    "calibrate_joint_centers",
    "calibrate_motion",
    "calibrate_pose",
    "calibrate_sagittal",
    "calibrate_session",
    "default_plan",
    "load_session_plan",
]
