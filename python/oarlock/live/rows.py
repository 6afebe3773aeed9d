"""Readings gathered by stream, and a recording of them. For the recording of a session, and for a guided start."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import oarlock
from oarlock.live.intake import Sampled
from oarlock.live.rig import Rig
from oarlock.recording.streams import Stream
from oarlock.storage.errors import DataError


@dataclass
class Rows:
    """Readings of a rig's streams; of two with the same time the first one counts.

    Args:
        rig: which kind each stream is of.
    """

    rig: Rig
    _rows: dict[str, dict[float, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.clear()

    def add(self, sampled: Iterable[Sampled]) -> None:
        """Takes readings."""
        for one in sampled:
            self._rows[one.stream].setdefault(one.time_s, one.values)

    def clear(self) -> None:
        """Forgets all readings."""
        self._rows = {feed.stream: {} for feed in self.rig.feeds}

    def recording(self, from_s: float = -np.inf, to_s: float = np.inf) -> oarlock.Recording:
        """The readings as a recording.

        Args:
            from_s: of this time or later.
            to_s: of this time or earlier.

        Raises:
            DataError: there is no reading.
        """
        rows = {
            name: {t: values for t, values in own.items() if from_s <= t <= to_s}
            for name, own in self._rows.items()
        }
        streams = list(_streams(self.rig, rows))
        if not streams:
            raise DataError("the packets have no reading of any of the rig's sensors; were its devices on?")
        return oarlock.Recording(streams, {"source": {"format": "live"}})


def _streams(rig: Rig, rows: Mapping[str, Mapping[float, Any]]) -> Iterator[Stream]:
    for feed in rig.feeds:
        if not rows[feed.stream]:
            continue
        times, values = zip(*sorted(rows[feed.stream].items(), key=lambda row: row[0]), strict=True)
        time_s = np.array(times)
        if feed.kind == "imu":
            yield oarlock.ImuStream(feed.stream, time_s, **_columns(values, feed.values))
        elif feed.kind == "orientation":
            yield oarlock.OrientationStream(
                feed.stream, time_s, _columns(values, ("quat_wxyz",), 4)["quat_wxyz"]
            )
        elif feed.kind == "vector":
            yield oarlock.VectorStream(feed.stream, time_s, _columns(values, ("value",))["value"])
        else:
            yield oarlock.ScalarStream(feed.stream, time_s, np.array(values))


def _columns(values: tuple[Any, ...], names: tuple[str, ...], width: int = 3) -> dict[str, Any]:
    missing = (np.nan,) * width
    columns = {name: np.array([row.get(name, missing) for row in values]) for name in names}
    return {name: rows for name, rows in columns.items() if np.isfinite(rows).any()}
