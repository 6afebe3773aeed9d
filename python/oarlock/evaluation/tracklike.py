"""Protocols of a track for evaluation and report: the attributes that they read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STAMP_TOLERANCE_S = 1e-9
"""Time stamps closer than this count as equal, s."""


class SlowLike(Protocol):
    """One slow state over time, (T,) each, in its own unit."""

    @property
    def value(self) -> Floats: ...
    @property
    def std(self) -> Floats: ...
    @property
    def unit(self) -> str: ...


class InfoLike(Protocol):
    """Use of each sensor's readings in each update: (T, S) each; ``nis`` is NaN where nothing was measured."""

    @property
    def sensor_names(self) -> Sequence[str]: ...
    @property
    def nis(self) -> Floats: ...
    @property
    def used(self) -> NDArray[Any]: ...
    @property
    def rejected(self) -> NDArray[Any]: ...
    @property
    def missing(self) -> NDArray[Any]: ...
    @property
    def inertial_nis(self) -> Floats: ...
    @property
    def inertial_used(self) -> NDArray[Any]: ...
    @property
    def field(self) -> NDArray[Any]: ...
    @property
    def fault(self) -> NDArray[Any]: ...


class BeliefsLike(Protocol):
    """Full beliefs every few seconds: (B,), (B, n), (B, n, n)."""

    @property
    def time_s(self) -> Floats: ...
    @property
    def mean(self) -> Floats: ...
    @property
    def covariance(self) -> Floats: ...
    @property
    def state_names(self) -> Sequence[str]: ...


class TrackLike(Protocol):
    """A track, estimated or true: (T,) stamps in s, (T, n_coordinates) in rad or m and their rates per s."""

    @property
    def model(self) -> Any: ...
    @property
    def time_s(self) -> Floats: ...
    @property
    def joint_names(self) -> Sequence[str]: ...
    @property
    def coordinate_names(self) -> Sequence[str]: ...
    @property
    def q(self) -> Floats: ...
    @property
    def qd(self) -> Floats: ...
    @property
    def qdd(self) -> Floats: ...
    @property
    def q_std(self) -> Floats: ...
    @property
    def observed(self) -> Bools: ...
    @property
    def slow(self) -> Mapping[str, SlowLike]: ...
    @property
    def info(self) -> Any: ...
    @property
    def beliefs(self) -> Any: ...
    @property
    def provenance(self) -> Mapping[str, Any]: ...
    @property
    def notes(self) -> Sequence[str]: ...
    @property
    def smoothed(self) -> bool: ...

    def __getitem__(self, name: str, /) -> Any: ...

    def frame_positions(self, frame: str, /) -> Floats: ...


@dataclass(frozen=True)
class Interval:
    """A stretch of time, s, both ends included."""

    start_s: float
    end_s: float

    @classmethod
    def after(cls, time_s: Floats, settle_s: float) -> Interval:
        """The interval from ``settle_s`` after the first time stamp to the last one."""
        if not len(time_s):
            return cls(np.inf, -np.inf)
        return cls(float(time_s[0]) + settle_s, float(time_s[-1]))

    def of(self, time_s: Floats) -> Bools:
        """Mask of the time stamps inside the interval, (T,)."""
        inside: Bools = (time_s >= self.start_s - STAMP_TOLERANCE_S) & (
            time_s <= self.end_s + STAMP_TOLERANCE_S
        )
        return inside


def info_of(track: TrackLike) -> InfoLike | None:
    """The sensor infos; None for truth, or where no sensor is listed."""
    info: InfoLike | None = track.info
    return info if info is not None and len(info.sensor_names) else None


def beliefs_of(track: TrackLike) -> BeliefsLike | None:
    """The stored beliefs; None for a ground truth, or if none is stored."""
    beliefs: BeliefsLike | None = track.beliefs
    return beliefs if beliefs is not None and len(beliefs.time_s) else None
