"""Optical markers: files, gaps, smoothing, inverse kinematics and comparison with a track."""

from oarlock.markers.files import load_markers, save_markers
from oarlock.markers.trajectories import Markers

__all__ = ["Markers", "load_markers", "save_markers"]
