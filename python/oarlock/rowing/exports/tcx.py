"""Reads Training Center files (TCX): one activity of points in time, without entities and within limits."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from oarlock.rowing.exports.activity import Activity, known_columns
from oarlock.rowing.exports.cells import MOST
from oarlock.rowing.exports.starts import epoch_of_text
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.xml_stream import XmlStream

TITLE = "Training Center file (TCX)"
ROOT = "<TrainingCenterDatabase"

_MOST_BYTES = 200_000_000
_LONGEST = 1000
"""Characters of one element; longer ones, such as notes, are not read."""
_POINT = "Trackpoint"
# By the last two elements of the path below a point.
_READ = MappingProxyType(
    {
        (_POINT, "Time"): "time_s",
        ("Position", "LatitudeDegrees"): "latitude_deg",
        ("Position", "LongitudeDegrees"): "longitude_deg",
        (_POINT, "DistanceMeters"): "distance_m",
        ("HeartRateBpm", "Value"): "heart_rate_per_min",
        (_POINT, "Cadence"): "rate_per_min",
        ("TPX", "Speed"): "speed_m_s",
        ("TPX", "Watts"): "power_w",
    }
)
_ZERO_IS_MISSING = ("heart_rate_per_min", "rate_per_min")


@dataclass
class _Points:
    """What has been read so far: Unix or local seconds, and numbers by column, NaN where a point lacks one."""

    numbers: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in _READ.values()})
    is_local: bool | None = None
    activities: int = 0

    def begin(self) -> None:
        for column in self.numbers.values():
            column.append(np.nan)


def read_tcx(file: Path) -> Activity:
    """The activity of a file.

    Raises:
        DataError: it cannot be read, is no whole XML, declares entities, has several activities, or a value is no
            number; file and line.
    """
    reader = _TcxReader(file)
    reader.read()
    return _activity(file, reader.points)


def _activity(file: Path, points: _Points) -> Activity:
    at_s = np.array(points.numbers["time_s"])
    if not len(at_s):
        raise DataError(f"{file}: is a {TITLE}, but contains no points")
    columns = {**points.numbers, "time_s": np.round(at_s - at_s[0], 6)}
    for name in _ZERO_IS_MISSING:
        values = np.array(columns[name])
        columns[name] = np.where(values == 0.0, np.nan, values)
    back = int((np.diff(at_s) < 0.0).sum())
    notes = (f"the clock goes back {back} times; the points are as in the file",) if back else ()
    start = datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=float(at_s[0]))
    epoch = epoch_of_text(start.isoformat() + ("" if points.is_local else "+00:00"))
    return Activity(known_columns(columns), f"{file.name}: {TITLE}", epoch, notes)


class _TcxReader(XmlStream):
    """Collects the points."""

    def __init__(self, file: Path) -> None:
        super().__init__(file, "TCX file", _MOST_BYTES)
        self.points = _Points()
        self._words = ""

    def started(self, element: str, _attributes: dict[str, str]) -> None:
        """As `XmlStream.started`."""
        self._words = ""
        if element == _POINT:
            self.points.begin()
        elif element == "Activity":
            self.points.activities += 1
            if self.points.activities > 1:
                raise self.refused("begins a second activity. Export each activity to a file of its own.")

    def text_found(self, text: str) -> None:
        """As `XmlStream.text_found`."""
        if len(self._words) <= _LONGEST:
            self._words += text

    def ended(self, name: str) -> None:
        """As `XmlStream.ended`."""
        column = _READ.get((self.path[-2], self.path[-1])) if len(self.path) > 1 else None
        if column and _POINT in self.path:
            self.points.numbers[column][-1] = self._value(column, self._words.strip())
        if self.path.pop() == _POINT and np.isnan(self.points.numbers["time_s"][-1]):
            raise self.refused("a point ends without a Time. Is the file damaged?")
        self._words = ""

    def _value(self, column: str, text: str) -> float:
        element = self.path[-1]
        if column == "time_s":
            return self._seconds(text)
        try:
            value = float(text)
        except ValueError:
            value = np.inf
        if not abs(value) <= MOST:
            raise self.refused(f'{element}: "{text[:40]}" is not a number')
        return value

    def _seconds(self, text: str) -> float:
        try:
            moment = moment_of(epoch_of_text(text))
        except (ValueError, OverflowError):
            moment = None
        if moment is None:
            raise self.refused(f'Time: "{text[:40]}" is not a moment such as 2026-05-01T07:30:00Z')
        is_local = moment.kind == "local"
        if self.points.is_local not in (None, is_local):
            raise self.refused("some times have a zone, others none. Is the file damaged?")
        self.points.is_local = is_local
        return moment.seconds
