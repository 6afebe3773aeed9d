"""Optical markers: files, gaps, smoothing, inverse kinematics and comparison with a track."""

from oarlock.markers.arm import Arm, ArmPostures
from oarlock.markers.attachments import Attachment, attach_markers, load_attachments, save_attachments
from oarlock.markers.files import load_markers, save_markers
from oarlock.markers.gaps import FilledMarkers, Gap, fill_gaps
from oarlock.markers.inverse_kinematics import inverse_kinematics
from oarlock.markers.low_pass import low_pass
from oarlock.markers.posture_fit import PostureFit
from oarlock.markers.trajectories import Markers

__all__ = [
    "Arm",
    "ArmPostures",
    "Attachment",
    "FilledMarkers",
    "Gap",
    "Markers",
    "PostureFit",
    "attach_markers",
    "fill_gaps",
    "inverse_kinematics",
    "load_attachments",
    "load_markers",
    "low_pass",
    "save_attachments",
    "save_markers",
]
