"""How the frames of a track move: the courses that the picture's motion is compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from oarlock.movement.video.signals import LONGEST_GAP_S, Signals, even_signals, main_courses
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.tracking.places import model_of

if TYPE_CHECKING:
    from oarlock import Track


COURSES = 3
LEAST_KNOWN = 0.5
"""A frame counts if its place is known for at least this share of the samples."""


def body_motion(track: Track) -> Signals:
    """Courses of a track's motion in track time: three of the frames' velocities, and their size.

    Raises:
        DataError: no model, too short, or no frame moves.
    """
    names = model_of(track, "video").frame_names
    places = np.stack([track.frame_positions(name) for name in names], axis=1)
    return motion_of_places(track.time_s, places)


def motion_of_places(time_s: Floats, places_m: Floats) -> Signals:
    """Courses of the motion of places (T, F, 3), m in root axes, at times (T,), s; NaN where unknown.

    Raises:
        DataError: too short, or nothing moves.
    """
    known = np.asarray(np.isfinite(places_m).all(axis=2))
    kept = known.mean(axis=0) >= LEAST_KNOWN
    rows = known[:, kept].all(axis=1)
    if not kept.any() or rows.sum() < 8:
        raise DataError("video: no frame of the track has known places; align with a clap or --offset-s")
    times, places = time_s[rows], places_m[rows][:, kept]
    velocity = np.gradient(places, times, axis=0)
    # a velocity over a gap is a mean; even_signals leaves such gaps out
    velocity[np.gradient(times) > LONGEST_GAP_S] = 0.0
    speed = np.sqrt(np.mean(np.sum(velocity**2, axis=2), axis=1))
    if not np.any(speed > 1e-3):
        raise DataError("video: nothing moves in the track; align with a clap or --offset-s")
    even = even_signals(times, np.column_stack([speed, velocity.reshape(len(times), -1)]), "the track")
    main = main_courses(even.values[:, 1:], min(COURSES, even.values.shape[1] - 1))
    values = np.column_stack([even.values[:, 0], main])
    return Signals(even.start_s, np.where(even.valid[:, None], values, 0.0), even.valid)
