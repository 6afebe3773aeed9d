"""The last readings of each stream as plain numbers, so that a copy for another process takes no time."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import oarlock
from oarlock.live.rig import Feed
from oarlock.recording.streams import Stream

_WIDTHS = {"imu": 3, "orientation": 4, "vector": 3, "scalar": 1}


@dataclass
class Lately:
    """Readings of one stream, a row each: its time and its values, NaN for those that it lacks.

    Args:
        feed: of the stream.
        keep_s: older ones are forgotten.
    """

    feed: Feed
    keep_s: float
    rows: array[float] = field(default_factory=lambda: array("d"))

    @property
    def width(self) -> int:
        """Numbers in a row."""
        return 1 + _WIDTHS[self.feed.kind] * len(_names(self.feed))

    def add(self, time_s: float, values: float | Mapping[str, tuple[float, ...]]) -> None:
        """Takes a reading."""
        self.rows.append(time_s)
        if isinstance(values, float):
            self.rows.append(values)
        else:
            missing = (np.nan,) * _WIDTHS[self.feed.kind]
            for name in _names(self.feed):
                self.rows.extend(values.get(name, missing))
        if self.rows[0] < time_s - 2.0 * self.keep_s:
            self._forget(time_s - self.keep_s)

    def since(self, from_s: float) -> StreamRows:
        """The readings from a time on."""
        self._forget(from_s)
        return StreamRows(self.feed, self.width, self.rows.tobytes())

    def _forget(self, before_s: float) -> None:
        times = np.frombuffer(self.rows)[:: self.width]
        # Late readings come out of order; all before the first one that is young enough go.
        count = int(np.argmax(times >= before_s)) if (times >= before_s).any() else len(times)
        del times
        del self.rows[: count * self.width]


@dataclass(frozen=True)
class StreamRows:
    """Readings of one stream.

    Args:
        feed: of the stream.
        width: numbers in a row.
        data: rows of float64.
    """

    feed: Feed
    width: int
    data: bytes

    def __len__(self) -> int:
        return len(self.data) // (8 * self.width)

    def stream(self) -> Stream:
        """The readings in the order of their times."""
        rows = np.frombuffer(self.data).reshape(-1, self.width)
        time_s, first = np.unique(rows[:, 0], return_index=True)
        values = rows[first, 1:]
        if self.feed.kind == "imu":
            columns = {name: values[:, 3 * k : 3 * k + 3] for k, name in enumerate(_names(self.feed))}
            read = {name: rows for name, rows in columns.items() if np.isfinite(rows).any()}
            return oarlock.recording.ImuStream(self.feed.stream, time_s, **read)
        if self.feed.kind == "orientation":
            return oarlock.recording.OrientationStream(self.feed.stream, time_s, values)
        if self.feed.kind == "vector":
            return oarlock.recording.VectorStream(self.feed.stream, time_s, values)
        return oarlock.recording.ScalarStream(self.feed.stream, time_s, values[:, 0])


def _names(feed: Feed) -> tuple[str, ...]:
    return feed.values if feed.kind == "imu" else ("quat_wxyz" if feed.kind == "orientation" else "value",)
