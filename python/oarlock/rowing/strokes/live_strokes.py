"""`LiveStrokes`: finds catches and finishes during rowing, for live feedback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from oarlock import Model
from oarlock.rowing.strokes.events import PAIR_S, Event, SideStrokes, mean_event
from oarlock.rowing.strokes.reversal_finder import ReversalFinder
from oarlock.rowing.strokes.signals import KINDS, SOURCES, LeakySum, trunk_axis
from oarlock.storage.errors import DataError

_READ_BY = {
    "oars": {"r_oar_phi": "r", "l_oar_phi": "l", "oar_phi": ""},
    "handle": {"handle": ""},
    "seat": {"seat": ""},
    "trunk": {"trunk": ""},
    "trunk_gyro": {"back": ""},
}
_SILENT_S = 0.5
_LATEST_S = 0.27


@dataclass(frozen=True)
class StrokeEvent:
    """A catch or a finish.

    Attributes:
        kind: `catch` or `finish`.
        time_s: when, s; of two oars the mean.
        time_std_s: its standard deviation.
        value: the movement there, in `KINDS`' unit: an oar's angle, rad; of two oars the mean.
        published_s: time stamp of the reading with which it was published.
        replaces: replaces the last event of this kind, because the movement continued.
        sides: by side "r" and "l", or "" of one signal.
        drive_time_s: of a finish, from its catch; NaN if that was not seen.
        rate_per_min: of a catch, from the catch before; NaN if there was none or the signal fell silent between.
    """

    kind: str
    time_s: float
    time_std_s: float
    value: float
    published_s: float
    replaces: bool
    sides: Mapping[str, Event]
    drive_time_s: float = np.nan
    rate_per_min: float = np.nan


@dataclass
class _Side:
    finder: ReversalFinder
    strokes: SideStrokes
    last_s: float = -np.inf


@dataclass
class _Waiting:
    """An event of one oar that waits for the other's."""

    kind: str
    until_s: float
    replaces: bool
    events: dict[str, Event]


@dataclass
class LiveStrokes:
    """The strokes of `find_strokes`, found as they happen: the same finder on the same readings, so the same times.

    A finish is published as soon as the movement has come back by a tenth of the smallest stroke and the readings of
    up to 0.2 s behind it are there, so within 0.3 s of a usual finish. An oar waits that long for the other one; should
    that one turn later, by up to 0.2 s, an event of both replaces that of the first.

    Args:
        source: `oars`, `handle`, `seat`, `trunk` (its angle, say of a tracker's belief) or `trunk_gyro`.
        model: gives the mount of the unit on the back; needed only for `trunk_gyro`.

    Raises:
        DataError: no such source, or `trunk_gyro` without a model.
    """

    source: str = "oars"
    model: Model | None = None
    _sides: dict[str, _Side] = field(default_factory=dict)
    _waiting: list[_Waiting] = field(default_factory=list)
    _alone: list[_Waiting] = field(default_factory=list)
    _last: dict[str, StrokeEvent] = field(default_factory=dict)
    _segments: int = 0
    _lean: LeakySum = field(default_factory=LeakySum)

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise DataError(f"strokes: no source '{self.source}'; choose one of {', '.join(SOURCES)}")
        if self.source == "trunk_gyro":
            if self.model is None:
                raise DataError("strokes: 'trunk_gyro' needs the model, which contains the mount of the unit")
            self._axis = trunk_axis(self.model)

    def step(self, time_s: float, readings: Mapping[str, ArrayLike]) -> list[StrokeEvent]:
        """Return the events that this sample completes.

        Args:
            time_s: its stamp, s; not before the last.
            readings: by stream, as `Tracker.sample` takes them; streams that tell no strokes are passed over. Of `back`
                the first three numbers are its gyroscope's, rad/s.

        Raises:
            DataError: a stamp before the last one.
        """
        for name, side in _READ_BY[self.source].items():
            if name in readings:
                self._read(side, float(time_s), self._number(float(time_s), readings[name]))
        return self._due(float(time_s))

    def _number(self, time_s: float, reading: ArrayLike) -> float:
        if self.source == "trunk_gyro":
            gyro = np.ravel(np.asarray(reading, dtype=np.float64))[:3]
            return self._lean.step(time_s, float(gyro @ self._axis))
        return KINDS[self.source].sign * float(np.asarray(reading, dtype=np.float64))

    def _read(self, side: str, time_s: float, value: float) -> None:
        kind = KINDS[self.source]
        own = self._sides.setdefault(
            side, _Side(ReversalFinder(kind.least, kind.rests), SideStrokes(self.source))
        )
        if time_s < own.last_s:
            raise DataError(
                f"strokes: a reading at {time_s:.6f} s came after one at {own.last_s:.6f} s; give them in order of time"
            )
        if np.isnan(value):
            return
        own.last_s = time_s
        for reversal in own.finder.step(time_s, value):
            told = own.strokes.add(reversal, own.finder.segment)
            if told is not None:
                self._join(side, time_s, *told)

    def _join(self, side: str, time_s: float, kind: str, event: Event, replaces: bool) -> None:
        for waiting in (*self._waiting, *self._alone):
            (other,) = list(waiting.events.values())[:1]
            near = abs(other.time_s - event.time_s) <= PAIR_S
            if waiting.kind == kind and side not in waiting.events and near:
                if waiting in self._alone:
                    self._alone.remove(waiting)
                    self._waiting.append(waiting)
                    waiting.replaces = True
                waiting.events[side] = event
                waiting.until_s = time_s
                return
        alone = all(time_s - s.last_s > _SILENT_S for name, s in self._sides.items() if name != side)
        until_s = time_s if alone else max(time_s, min(time_s + PAIR_S, event.time_s + _LATEST_S))
        self._waiting.append(_Waiting(kind, until_s, replaces, {side: event}))

    def _due(self, time_s: float) -> list[StrokeEvent]:
        ready = [waiting for waiting in self._waiting if waiting.until_s <= time_s]
        self._waiting = [waiting for waiting in self._waiting if waiting.until_s > time_s]
        self._alone += [waiting for waiting in ready if len(waiting.events) < len(self._sides)]
        self._alone = [waiting for waiting in self._alone if time_s - waiting.until_s < 2.0 * PAIR_S]
        return [self._event(waiting, time_s) for waiting in ready]

    def _event(self, waiting: _Waiting, now_s: float) -> StrokeEvent:
        time_s, std = mean_event(list(waiting.events.values()))
        value = KINDS[self.source].sign * float(np.mean([e.reversal.value for e in waiting.events.values()]))
        drive_s, rate = np.nan, np.nan
        catch = self._last.get("catch")
        segments = sum(side.finder.segment for side in self._sides.values())
        if catch is not None and segments == self._segments and time_s > catch.time_s:
            drive_s = time_s - catch.time_s if waiting.kind == "finish" else np.nan
            rate = 60.0 / (time_s - catch.time_s) if waiting.kind == "catch" else np.nan
        if waiting.kind == "catch":
            self._segments = segments
        event = StrokeEvent(
            waiting.kind,
            time_s,
            std,
            value,
            now_s,
            waiting.replaces,
            MappingProxyType(dict(waiting.events)),
            drive_s,
            rate,
        )
        self._last[waiting.kind] = event
        return event
