"""Reads Training Center files (TCX): one activity of points in time, without entities and within limits."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from xml.parsers import expat

import numpy as np

from oarlock.rowing.exports.activity import Activity, known_columns
from oarlock.rowing.exports.cells import MOST
from oarlock.rowing.exports.starts import epoch_of_text
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular, shown_bytes

TITLE = "Training Center file (TCX)"
ROOT = "<TrainingCenterDatabase"

_MOST_BYTES = 200_000_000
_AT_ONCE_BYTES = 2**20
_DEEPEST = 32
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
    reader = _Reader(file)
    try:
        with open_regular(file) as stream:
            size = 0
            while block := stream.read(_AT_ONCE_BYTES):
                size += len(block)
                if size > _MOST_BYTES:
                    raise DataError(f"{file}: has more than the {shown_bytes(_MOST_BYTES)} that are read")
                # expat takes no line breaks before the declaration; some apps write them
                reader.parser.Parse(block.lstrip() if size == len(block) else block, False)
            reader.parser.Parse(b"", True)
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from error
    except (expat.ExpatError, LookupError, UnicodeError) as error:
        where = f"{file}:{reader.parser.CurrentLineNumber}"
        raise DataError(f"{where}: is no whole XML ({error}). Was it cut off? Export it again.") from error
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


class _Reader:
    """Takes what the XML parser reports and collects the points."""

    def __init__(self, file: Path) -> None:
        self.points = _Points()
        self.parser = expat.ParserCreate(namespace_separator="}")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.EntityDeclHandler = self._entity
        self._file = file
        self._path: list[str] = []
        self._words = ""

    def _refused(self, text: str) -> DataError:
        return DataError(f"{self._file}:{self.parser.CurrentLineNumber}: {text}")

    def _entity(self, *_: object) -> None:
        raise self._refused("declares an entity, which a TCX file never needs. It is not read.")

    def _start(self, name: str, _attributes: dict[str, str]) -> None:
        element = name.rpartition("}")[2]
        self._path.append(element)
        self._words = ""
        if len(self._path) > _DEEPEST:
            raise self._refused(f"elements are nested more than {_DEEPEST} deep; this is no TCX file")
        if element == _POINT:
            self.points.begin()
        elif element == "Activity":
            self.points.activities += 1
            if self.points.activities > 1:
                raise self._refused("begins a second activity. Export each activity to a file of its own.")

    def _text(self, text: str) -> None:
        if len(self._words) <= _LONGEST:
            self._words += text

    def _end(self, _name: str) -> None:
        column = _READ.get((self._path[-2], self._path[-1])) if len(self._path) > 1 else None
        if column and _POINT in self._path:
            self.points.numbers[column][-1] = self._value(column, self._words.strip())
        if self._path.pop() == _POINT and np.isnan(self.points.numbers["time_s"][-1]):
            raise self._refused("a point ends without a Time. Is the file damaged?")
        self._words = ""

    def _value(self, column: str, text: str) -> float:
        element = self._path[-1]
        if column == "time_s":
            return self._seconds(text)
        try:
            value = float(text)
        except ValueError:
            value = np.inf
        if not abs(value) <= MOST:
            raise self._refused(f'{element}: "{text[:40]}" is not a number')
        return value

    def _seconds(self, text: str) -> float:
        try:
            moment = moment_of(epoch_of_text(text))
        except (ValueError, OverflowError):
            moment = None
        if moment is None:
            raise self._refused(f'Time: "{text[:40]}" is not a moment such as 2026-05-01T07:30:00Z')
        is_local = moment.kind == "local"
        if self.points.is_local not in (None, is_local):
            raise self._refused("some times have a zone, others none. Is the file damaged?")
        self.points.is_local = is_local
        return moment.seconds
