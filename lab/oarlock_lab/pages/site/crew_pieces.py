"""Recordings of a simulated crew with planted delays, for the gallery."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from oarlock import Recording
from oarlock.recording import ScalarStream

LATE_S = {"bow": 0.025, "two": 0.0, "three": -0.004, "stroke": 0.0}
"""Catch and finish of each seat, later than those of the stroke seat."""
PERIOD_S, STROKES, DRIVE_SHARE = 2.4, 40, 0.45
ANGLES_RAD = (-1.1, 0.6)
RATE_HZ = 100.0


def write_crew(folder: Path) -> None:
    """A recording of each seat: both oars as encoders; an angle is a cosine in drive and in recovery."""
    random = np.random.default_rng(4)
    catch_s = np.cumsum(PERIOD_S * (1.0 + 0.015 * random.normal(size=STROKES)))
    time_s = np.arange(0.0, catch_s[-1], 1.0 / RATE_HZ)
    middle_rad, half_rad = 0.5 * sum(ANGLES_RAD), 0.5 * (ANGLES_RAD[1] - ANGLES_RAD[0])
    for seat, late_s in LATE_S.items():
        own_s = catch_s + late_s + 0.006 * random.normal(size=STROKES)
        turns_s = np.sort(np.concatenate([own_s, own_s[:-1] + DRIVE_SHARE * np.diff(own_s)]))
        turns = np.interp(time_s, turns_s, np.arange(len(turns_s)))
        angle_rad = middle_rad - half_rad * np.cos(np.pi * turns)
        streams = [
            ScalarStream(f"{side}_oar_phi", time_s, angle_rad + 0.001 * random.normal(size=len(time_s)))
            for side in "rl"
        ]
        Recording(streams).save(folder / seat)
