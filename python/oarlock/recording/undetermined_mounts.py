"""Mounts whose heading a calibration does not determine: notes of a track, and units that `suspects` cannot compare."""

from __future__ import annotations

from math import degrees, radians
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

UNDETERMINED_RAD = radians(45.0)
"""Standard deviation of a mount about an axis above which its rotation is as good as unknown."""


def undetermined_mounts(calibration: Calibration | None) -> dict[str, float]:
    """Sensors with such a mount, and its largest standard deviation, rad."""
    stds = {} if calibration is None else {n: float(s.max()) for n, s in calibration.mount_stds_rad.items()}
    return {name: std for name, std in stds.items() if std > UNDETERMINED_RAD}


def mount_notes(recording: Recording, calibration: Calibration | None) -> tuple[str, ...]:
    """One sentence for each of them that was recorded."""
    return tuple(
        f"{name}: the heading of its mount is not determined (standard deviation {degrees(std):.0f} deg), so angles "
        "between its segment and others are not usable. Record a guided session (`oarlock calibrate session`), or the "
        "movement with magnetometers, or with this segment bending by 20 deg forward (`oarlock calibrate sagittal`)"
        for name, std in undetermined_mounts(calibration).items()
        if name in recording
    )
