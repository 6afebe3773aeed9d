"""Parses the XML of an MVNX file as a stream, without entities and within limits. For `mvnx`."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.xml_stream import XmlStream

WIDTHS = MappingProxyType(
    {"orientation": 4, "sensorOrientation": 4, "sensorMagneticField": 3, "sensorFreeAcceleration": 3}
)
"""Elements of a frame that are read -> numbers per segment or sensor."""
_LONGEST_TEXT = 2**20


@dataclass
class MvnxContents:
    """What a file has.

    Args:
        file: the file.
        software: version of MVN; empty if not stated.
        subject: attributes of the subject, such as frameRate and recDate.
        segments: labels of the segments, in order.
        sensors: labels of the sensors, in order.
        lines: line of each frame of type "normal".
        time: its attribute "time".
        index: its attribute "index".
        first_ms: attribute "ms" of the first of them, milliseconds since 1970; empty if not stated.
        numbers: all numbers of each element that is read.
        others: other elements of the frames.
    """

    file: Path
    software: str = ""
    subject: dict[str, str] = field(default_factory=dict)
    segments: list[str] = field(default_factory=list)
    sensors: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    time: list[str] = field(default_factory=list)
    index: list[str] = field(default_factory=list)
    first_ms: str = ""
    numbers: dict[str, array[float]] = field(default_factory=dict)
    others: dict[str, None] = field(default_factory=dict)

    def rows(self, element: str) -> Floats | None:
        """(frames, n, width) of an element; None if the frames have none."""
        found = self.numbers.get(element)
        if found is None:
            return None
        values = np.frombuffer(found, dtype=np.float64)
        return values.reshape(len(self.lines), -1, WIDTHS[element])

    def places(self) -> Sequence[str]:
        """File and line of each frame."""
        return FramePlaces(self)


class FramePlaces(Sequence[str]):
    """File and line of each frame, as text for errors."""

    def __init__(self, contents: MvnxContents) -> None:
        self._contents = contents

    def __len__(self) -> int:
        return len(self._contents.lines)

    def __getitem__(self, row: Any) -> Any:
        return f"{self._contents.file}:{self._contents.lines[row]}, frame"


def parsed_mvnx(file: Path) -> MvnxContents:
    """Read a file.

    Raises:
        DataError: it cannot be read, is no XML, declares entities, or a frame differs from the first; names the line.
    """
    reader = _MvnxReader(file)
    reader.read()
    return reader.found


class _MvnxReader(XmlStream):
    """Collects the frames."""

    def __init__(self, file: Path) -> None:
        super().__init__(file, "MVNX file")
        self.found = MvnxContents(file)
        self._parts: list[str] | None = None
        self._length = 0
        self._seen: set[str] | None = None
        self._elements: set[str] | None = None

    def started(self, element: str, attributes: dict[str, str]) -> None:
        """As `XmlStream.started`."""
        if self._seen is not None and self.path[-2:-1] == ["frame"]:
            self._start_of_part(element, self._seen)
        elif element == "frame" and attributes.get("type") == "normal":
            self._start_of_frame(attributes)
        elif element in ("segment", "sensor"):
            labels = self.found.segments if element == "segment" else self.found.sensors
            labels.append(attributes.get("label", "").strip())
        elif element == "subject":
            if self.found.subject:
                raise self.refused("begins a second subject. Export each subject to a file of its own.")
            self.found.subject = dict(attributes)
        elif element == "mvn":
            self.found.software = attributes.get("version", "")

    def _start_of_frame(self, attributes: dict[str, str]) -> None:
        found = self.found
        found.first_ms = found.first_ms if found.lines else attributes.get("ms", "")
        found.lines.append(self.line)
        found.time.append(attributes.get("time", ""))
        found.index.append(attributes.get("index", ""))
        self._seen = set()

    def _start_of_part(self, element: str, seen: set[str]) -> None:
        if element not in WIDTHS:
            self.found.others[element] = None
            return
        if element in seen:
            raise self.refused(f"this frame has <{element}> twice")
        seen.add(element)
        self._parts, self._length = [], 0

    def text_found(self, text: str) -> None:
        """As `XmlStream.text_found`."""
        if self._parts is None:
            return
        self._length += len(text)
        if self._length > _LONGEST_TEXT:
            raise self.refused(f"<{self.path[-1]}> has more than {_LONGEST_TEXT:,} characters")
        self._parts.append(text)

    def ended(self, name: str) -> None:
        """As `XmlStream.ended`."""
        element = self.path.pop()
        if self._parts is not None and element in WIDTHS:
            self._add(element, "".join(self._parts))
            self._parts = None
        elif element == "frame" and self._seen is not None:
            self._end_of_frame(self._seen)

    def _end_of_frame(self, seen: set[str]) -> None:
        if self._elements is not None and seen != self._elements:
            odd = sorted(self._elements ^ seen)[0]
            raise self.refused(f"this frame and the first differ: only one of them has <{odd}>")
        self._elements, self._seen = seen, None

    def _add(self, element: str, text: str) -> None:
        try:
            if "_" in text:
                raise ValueError
            values = [float(part) for part in text.split()]
        except ValueError:
            raise self.refused(f"<{element}> contains a text that is not a number") from None
        known = self.found.numbers.setdefault(element, array("d"))
        width = len(known) // max(len(self.found.lines) - 1, 1) if known else len(values)
        if len(values) != width or not values or width % WIDTHS[element]:
            expected = f"{width}" if known else f"a multiple of {WIDTHS[element]}"
            raise self.refused(f"<{element}> has {len(values)} numbers, expected {expected}")
        known.extend(values)
