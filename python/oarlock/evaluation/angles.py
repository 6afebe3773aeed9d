"""Named angles of ball and free joints and their errors outside the singular regions, for `evaluate`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.evaluation.errors import true_values
from oarlock.model.angle_sequence import angle_labels, angles_near, near_singular
from oarlock.model.coordinates import JointPart
from oarlock.model.rotation import wrap
from oarlock.storage.arrays import Bools, Floats
from oarlock.tracking.track import Track


@dataclass(frozen=True)
class NamedAngles:
    """Angles and standard deviations (T, 3), rad, by name; `near_singular` (T,) is True near a pole."""

    names: tuple[str, ...]
    value: Floats
    std: Floats
    near_singular: Bools


def named_angles(track: Track, part: JointPart) -> NamedAngles:
    """The angles of a rotation by the model's own sequence: `shoulder YXY y1`, `pelvis.rotation ZXY z`."""
    series = track.ball(part.joint)
    sequence = series.angle_sequence
    return NamedAngles(
        names=tuple(f"{part.name} {sequence} {label}" for label in angle_labels(sequence)),
        value=series.angles_rad(),
        std=series.angles_std_rad(),
        near_singular=series.near_singular(),
    )


def angle_error(track: Track, truth: Track, part: JointPart) -> Floats:
    """Estimate minus truth at the track's stamps, (T, 3) rad; NaN without truth, and near a pole of either.

    Several triples of angles describe the true rotation; the one nearest to the estimate's is used.
    """
    series = track.ball(part.joint)
    sequence, true = series.angle_sequence, true_values(track, truth, part)
    value = series.angles_rad()
    error = np.full(value.shape, np.nan)
    good = np.asarray(np.isfinite(value).all(axis=1) & np.isfinite(true).all(axis=1))
    good[good] = ~(series.near_singular()[good] | near_singular(true[good], sequence))
    error[good] = wrap(value[good] - angles_near(true[good], sequence, value[good]))
    return error
