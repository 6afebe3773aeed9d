"""Positions of all frames of a track, for the export as markers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from oarlock.evaluation.markers.trajectories import Markers
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.tracking.places import poses_of

if TYPE_CHECKING:
    from oarlock.tracking.track import Track


def frame_places(track: Track) -> Markers:
    """Origins of all frames in root axes, m, equal to `Track.frame_positions`; NaN where a reading is missing.

    Raises:
        DataError: the track has no model.
    """
    if track.model is None:
        raise DataError("frame_places: this track was loaded without its model; load the model file again")
    places = poses_of(track)[..., :3, 3]
    places = np.where(np.isfinite(places).all(axis=2, keepdims=True), places, np.nan)
    return Markers(tuple(track.model.frame_names), track.time_s, places)


def ground_from_root(up: Floats, y_up: bool) -> Floats:
    """OpenSim's ground from the root, (4, 4): the smallest rotation of `up` (3,) to Y, or none."""
    pose = np.eye(4)
    if not y_up:
        return pose
    axis, cosine = np.cross(up, [0.0, 1.0, 0.0]), float(up[1])
    if np.linalg.norm(axis) < 1e-12:
        pose[:3, :3] = np.diag([1.0, np.sign(cosine), np.sign(cosine)])
        return pose
    cross = np.cross(np.eye(3), axis)
    pose[:3, :3] = np.eye(3) + cross + cross @ cross / (1.0 + cosine)  # Rodrigues' formula
    return pose
