"""Readings gathered by stream, and a recording of them. For the recording of a session, and for a guided start."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

import oarlock
from oarlock.live.intake import SensorReading
from oarlock.live.rig import Feed, Rig
from oarlock.recording.streams import Stream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_WIDTHS = {"imu": 3, "vector": 3, "orientation": 4}


class StreamBuffer:
    """Readings of a rig's streams; of two with the same time the first one counts.

    Args:
        rig: which kind each stream is of.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.clear()

    def add(self, sampled: Iterable[SensorReading]) -> None:
        """Takes readings."""
        for one in sampled:
            self._rows[one.stream].add(one)

    def clear(self) -> None:
        """Forgets all readings."""
        self._rows = {feed.stream: _Columns(feed) for feed in self.rig.feeds}

    def recording(
        self,
        meta: Mapping[str, object] = MappingProxyType({}),
        *,
        from_s: float = -np.inf,
        to_s: float = np.inf,
    ) -> oarlock.Recording:
        """The readings as a recording.

        Args:
            meta: entries beside the source.
            from_s: of this time or later.
            to_s: of this time or earlier.

        Raises:
            DataError: there is no reading.
        """
        found = [own.stream(from_s, to_s) for own in self._rows.values()]
        streams = [stream for stream in found if stream is not None]
        if not streams:
            raise DataError("the packets have no reading of any of the rig's sensors; were its devices on?")
        return oarlock.Recording(streams, {"source": {"format": "live"}, **meta})


class _Columns:
    """The readings of one stream, as columns of numbers: hours of them fit into memory."""

    def __init__(self, feed: Feed) -> None:
        self.feed, self.time_s = feed, array("d")
        value = "quat_wxyz" if feed.kind == "orientation" else "value"
        self._missing = (math.nan,) * _WIDTHS.get(feed.kind, 1)
        self._columns = {name: array("d") for name in (feed.values if feed.kind == "imu" else (value,))}

    def add(self, one: SensorReading) -> None:
        self.time_s.append(one.time_s)
        values: Any = one.values if isinstance(one.values, Mapping) else {"value": (one.values,)}
        for name, column in self._columns.items():
            column.extend(values.get(name, self._missing))

    def stream(self, from_s: float, to_s: float) -> Stream | None:
        """The readings by time."""
        # A copy: an array that numpy looks into cannot grow.
        time_s, rows = np.unique(np.array(self.time_s), return_index=True)
        is_in = (time_s >= from_s) & (time_s <= to_s)
        if not is_in.any():
            return None
        time_s, values = time_s[is_in], {name: self._of(name)[rows[is_in]] for name in self._columns}
        name = self.feed.stream
        if self.feed.kind == "imu":
            found = {k: column for k, column in values.items() if np.isfinite(column).any()}
            return oarlock.recording.ImuStream(name, time_s, **found)
        if self.feed.kind == "orientation":
            return oarlock.recording.OrientationStream(name, time_s, values["quat_wxyz"])
        if self.feed.kind == "vector":
            return oarlock.recording.VectorStream(name, time_s, values["value"])
        return oarlock.recording.ScalarStream(name, time_s, values["value"][:, 0])

    def _of(self, name: str) -> Floats:
        return np.array(self._columns[name]).reshape(-1, len(self._missing))
