"""Self-calibration from ordinary movement: what closed loops and known joints tell about one wearing."""

from __future__ import annotations

from oarlock.motion_calibration.calibrate import calibrate_motion

__all__ = ["calibrate_motion"]
