"""An interval of time, and the parts of a track that may be missing, for evaluation and report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Bools, Floats
from oarlock.tracking.records import Beliefs, SensorInfo
from oarlock.tracking.track import Track

STAMP_TOLERANCE_S = 1e-9
"""Stamps closer than this are the same instant."""


@dataclass(frozen=True)
class Interval:
    """A stretch of time, s, both ends included."""

    start_s: float
    end_s: float

    @classmethod
    def after(cls, time_s: Floats, settle_s: float) -> Interval:
        """From ``settle_s`` after the first stamp to the last one."""
        if not len(time_s):
            return cls(np.inf, -np.inf)
        return cls(float(time_s[0]) + settle_s, float(time_s[-1]))

    def of(self, time_s: Floats) -> Bools:
        """Which stamps lie inside, (T,)."""
        inside: Bools = (time_s >= self.start_s - STAMP_TOLERANCE_S) & (
            time_s <= self.end_s + STAMP_TOLERANCE_S
        )
        return inside


def info_of(track: Track) -> SensorInfo | None:
    """The sensor infos; None for truth, or where no sensor is listed."""
    info = track.info
    return info if info is not None and len(info.sensor_names) else None


def beliefs_of(track: Track) -> Beliefs | None:
    """The kept beliefs; None for truth, or where none was kept."""
    beliefs = track.beliefs
    return beliefs if beliefs is not None and len(beliefs.time_s) else None
