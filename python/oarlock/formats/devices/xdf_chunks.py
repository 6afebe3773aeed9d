"""Parses XDF files of the Lab Streaming Layer: streams with their stamps, values and clock measurements as written.

Source: "XDF: Extensible Data Format", version 1.0 (sccn/xdf on GitHub, wiki page "Specifications").
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from oarlock.recording.streams import MOST_STREAMS
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

MAGIC = b"XDF:"
_BOUNDARY = bytes.fromhex("43A546DCCBF5410FB30ED5467383CBE4")
_FILE_HEADER, _STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _BOUNDARY_TAG, _STREAM_FOOTER = range(1, 7)
_TEXT = "string"
_NUMBERS = MappingProxyType(
    {"float32": "<f4", "double64": "<f8", "int8": "<i1", "int16": "<i2", "int32": "<i4", "int64": "<i8"}
)
_STAMPED = 8
_MOST_NOTES = 5
MOST_TEXTS = 10_000
_LATEST_S = 1e11
"""Stamps are seconds since a machine was started, or since 1970."""


@dataclass(frozen=True)
class ChannelInfo:
    """What a header says of a channel; empty texts where it says nothing."""

    label: str
    unit: str
    kind: str


@dataclass
class XdfStream:
    """A stream as it was recorded.

    Args:
        number: of the stream in the file.
        name: its name.
        kind: its type, such as EEG, Markers or IMU.
        rate_hz: the nominal rate; 0 for a stream without one.
        channels: of each sample, in order.
        values_are: a numpy type, or "string".
        stamps: (n,) s of the sender's clock, one array a chunk.
        values: (n, channels), one array a chunk.
        texts: of the first `MOST_TEXTS` samples of a stream of texts, one for each channel.
        offsets_before: clock measurements that the file has before each chunk of samples.
        measured: (time of the sender's clock, what to add to reach the recorder's clock), s, in the order of the file.
    """

    number: int
    name: str
    kind: str
    rate_hz: float
    channels: tuple[ChannelInfo, ...]
    values_are: str
    stamps: list[Floats] = field(default_factory=list)
    values: list[NDArray[np.generic]] = field(default_factory=list)
    texts: list[list[str]] = field(default_factory=list)
    offsets_before: list[int] = field(default_factory=list)
    measured: list[tuple[float, float]] = field(default_factory=list)

    @property
    def is_text(self) -> bool:
        """Whether its samples are texts."""
        return self.values_are == _TEXT

    @property
    def raw_time_s(self) -> Floats:
        """(T,) stamps of the sender's clock, s."""
        return np.concatenate([np.zeros(0), *self.stamps])


@dataclass(frozen=True)
class XdfFile:
    """The streams of a file in the order of their headers, when it was begun (or ""), and what could not be read."""

    streams: tuple[XdfStream, ...]
    begun: str
    notes: tuple[str, ...]


def read_chunks(file: Path) -> XdfFile:
    """All streams of a file. After damage, reading goes on at the next boundary chunk.

    Raises:
        DataError: the file cannot be read, is no XDF file or has no stream.
    """
    content = read_bytes(file)
    if content[:2] == b"\x1f\x8b":
        raise DataError(f"{file}: is compressed. Unpack it with `gunzip` and import the .xdf file")
    if content[:4] != MAGIC:
        raise DataError(f'{file}: is no XDF file; it begins with {content[:4]!r}, expected "XDF:"')
    streams: dict[int, XdfStream] = {}
    begun = ""
    notes: list[str] = []
    for at, tag, body in _chunks(content, notes):
        try:
            if tag == _FILE_HEADER:
                begun = text_of(xml_of(body), "datetime")
            elif tag in (_STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET):
                _take(tag, body, streams)
        except (ValueError, KeyError, struct.error, ElementTree.ParseError) as error:
            notes.append(f"A chunk at byte {at} is damaged and was left out ({_reason(error)}).")
    if not streams:
        raise DataError(f"{file}: has no stream that can be read. {' '.join(notes[:1])}".rstrip())
    more = [f"{len(notes) - _MOST_NOTES} more places are damaged."] if len(notes) > _MOST_NOTES else []
    return XdfFile(tuple(streams.values()), begun, (*notes[:_MOST_NOTES], *more))


def _reason(error: Exception) -> str:
    return f"of unknown stream {error}" if isinstance(error, KeyError) else str(error)


def _chunks(content: bytes, notes: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """Place, tag and content of each chunk."""
    at = len(MAGIC)
    while at < len(content):
        try:
            length, start = _length(content, at)
            if length < 2 or start + length > len(content):
                raise ValueError("it ends beyond the file")
        except (ValueError, struct.error, IndexError):
            found = content.find(_BOUNDARY, at)
            onward = len(content) if found < 0 else found + len(_BOUNDARY)
            notes.append(f"{onward - at} bytes from byte {at} on cannot be read; was the file cut off?")
            at = onward
            continue
        (tag,) = struct.unpack_from("<H", content, start)
        yield at, tag, content[start + 2 : start + length]
        at = start + length


def _length(content: bytes, at: int) -> tuple[int, int]:
    """A length of variable size, and the place after it."""
    width = content[at]
    if width not in (1, 4, 8):
        raise ValueError(f"the size of a length is {width} bytes")
    return int.from_bytes(_part(content, at + 1, width), "little"), at + 1 + width


def _part(content: bytes, at: int, count: int) -> bytes:
    found = content[at : at + count]
    if len(found) != count:
        raise ValueError("it is too short")
    return found


def _take(tag: int, body: bytes, streams: dict[int, XdfStream]) -> None:
    (number,) = struct.unpack_from("<I", body)
    if tag == _STREAM_HEADER:
        streams[number] = _stream(number, body[4:], streams)
    elif tag == _CLOCK_OFFSET:
        time_s, offset_s = struct.unpack_from("<2d", body, 4)
        _check_times(np.array([time_s, offset_s]))
        streams[number].measured.append((time_s, offset_s))
    else:
        _samples(streams[number], body, 4)


def _stream(number: int, body: bytes, streams: Mapping[int, XdfStream]) -> XdfStream:
    info = xml_of(body)
    values_are = text_of(info, "channel_format")
    if values_are != _TEXT and values_are not in _NUMBERS:
        raise ValueError(f'the format of its channels is "{values_are}"')
    count = int(text_of(info, "channel_count"))
    rate_hz = float(text_of(info, "nominal_srate") or 0.0)
    others = sum(len(stream.channels) for stream in streams.values() if stream.number != number)
    if not 0 < count <= MOST_STREAMS - others:
        raise ValueError(f"it has {count} channels after {others} others; at most {MOST_STREAMS} are read")
    name = text_of(info, "name") or f"stream {number}"
    rate_hz = rate_hz if 0.0 < rate_hz < 1e9 else 0.0
    return XdfStream(number, name, text_of(info, "type"), rate_hz, channels_of(info, count), values_are)


def channels_of(info: ElementTree.Element, count: int) -> tuple[ChannelInfo, ...]:
    """What the header of a stream says of its channels; nothing of those that it leaves out."""
    told = info.findall("desc/channels/channel")[:count]
    channels = [ChannelInfo(*(text_of(c, key) for key in ("label", "unit", "type"))) for c in told]
    return (*channels, *[ChannelInfo("", "", "")] * (count - len(channels)))


def xml_of(body: bytes) -> ElementTree.Element:
    """The header of a stream.

    Raises:
        ElementTree.ParseError: it is no XML.
    """
    return ElementTree.fromstring(body.decode("utf-8", "replace"))


def text_of(element: ElementTree.Element, key: str) -> str:
    """The text of a part, without spaces around it; empty if there is none."""
    return (element.findtext(key) or "").strip()


def _samples(stream: XdfStream, body: bytes, at: int) -> None:
    """One chunk of samples: each has a stamp, or is one nominal interval after the one before."""
    count, at = _length(body, at)
    cell_bytes = 2 if stream.is_text else np.dtype(_NUMBERS[stream.values_are]).itemsize
    if count * (1 + cell_bytes * len(stream.channels)) > len(body) - at:
        raise ValueError(f"it announces {count} samples in {len(body) - at} bytes")
    stamps = np.full(count, np.nan)
    texts: list[list[str]] = []
    values: list[NDArray[np.generic]] = []
    if stream.is_text:
        for index in range(count):
            stamps[index], at = _stamp(body, at)
            sample, at = _texts(body, at, len(stream.channels))
            texts.append(sample)
    else:
        values.append(_numbers(stream, body, at, stamps))
    _check_times(stamps[~np.isnan(stamps)])
    stream.texts += texts[: MOST_TEXTS - len(stream.texts)]
    stream.values += values
    stream.stamps.append(_deduced(stamps, stream))
    stream.offsets_before.append(len(stream.measured))


def _numbers(stream: XdfStream, body: bytes, at: int, stamps: Floats) -> NDArray[np.generic]:
    form, width = np.dtype(_NUMBERS[stream.values_are]), len(stream.channels)
    whole = np.dtype([("has", "u1"), ("stamp", "<f8"), ("values", form, (width,))])
    if len(body) - at == whole.itemsize * len(stamps):
        rows = np.frombuffer(body, whole, len(stamps), at)
        if (rows["has"] == _STAMPED).all():
            stamps[:] = rows["stamp"]
            return np.array(rows["values"])
    values = np.zeros((len(stamps), width), form)
    for index in range(len(stamps)):
        stamps[index], at = _stamp(body, at)
        values[index] = np.frombuffer(_part(body, at, width * form.itemsize), form)
        at += width * form.itemsize
    return values


def _stamp(body: bytes, at: int) -> tuple[float, int]:
    if _part(body, at, 1) == b"\0":
        return float("nan"), at + 1
    (stamp,) = struct.unpack("<d", _part(body, at + 1, 8))
    return stamp, at + 9


def _check_times(seconds: Floats) -> None:
    odd = np.flatnonzero(~(np.abs(seconds) < _LATEST_S))
    if odd.size:
        raise ValueError(f"a stamp is {seconds[odd[0]]:g} s")


def _texts(body: bytes, at: int, count: int) -> tuple[list[str], int]:
    found = []
    for _ in range(count):
        length, at = _length(body, at)
        found.append(_part(body, at, length).decode("utf-8", "replace"))
        at += length
    return found, at


def _deduced(stamps: Floats, stream: XdfStream) -> Floats:
    """Stamps for the samples without one, by the nominal interval from the last one that has a stamp."""
    given = ~np.isnan(stamps)
    if given.all():
        return stamps
    step_s = 1.0 / stream.rate_hz if stream.rate_hz else 0.0
    before = next((chunk[-1] for chunk in reversed(stream.stamps) if len(chunk)), 0.0)
    last = float(before)
    for index in range(len(stamps)):
        last = stamps[index] if given[index] else last + step_s
        stamps[index] = last
    return stamps
