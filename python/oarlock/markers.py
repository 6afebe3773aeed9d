"""Optical markers: files, gaps, filters, attachments, inverse kinematics, sensors simulated on a movement."""

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
from oarlock.formats.marker_files import load_markers

__all__ = [
    "Arm",
    "Attachment",
    "MarkerEvaluation",
    "Markers",
    "PointScore",
    "attach_markers",
    "evaluate_markers",
    "fill_gaps",
    "fit_body",
    "inverse_kinematics",
    "load_attachments",
    "load_markers",
    "low_pass",
    "save_attachments",
    "simulate_from_markers",
]
