"""Decodes the network stream of Xsens MVN (MXTP): poses of segments (type 02) and readings of trackers (type 23).

Sources: Xsens, "MVN real-time network streaming protocol specification" (MV0305P, revision N); sizes of items of
type 23 as an open parser has them (JongbinLim/xsens_mvn_ros2 on GitHub). The unit of angular velocity in type 23
could not be verified: without `gyro_unit` it is called `gyro_unknown_unit`. Versions of MVN before 2024 are
reported to lose 30 to 50 % of the packets: `count` shows it.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType

from oarlock.formats.devices.mvnx import FULL_BODY, SENSOR
from oarlock.formats.devices.unit_readings import stream_name
from oarlock.live.decoders.quantities import are_sound, radians
from oarlock.live.decoders.sample_clock import MillisecondClock
from oarlock.live.decoders.wrapping import Wrapping
from oarlock.live.reading import Reading, Value

Numbers = tuple[float, ...]
_HEAD = struct.Struct(">6sIBBIBBBB2xH")
_BEGIN = re.compile(rb"MXTP\d\d")
_BEGIN_BYTES = 6
_MOST_BYTES = _HEAD.size + 0xFFFF
_POSES, _TRACKERS = b"MXTP02", b"MXTP23"
_SIZES: Mapping[bytes, tuple[int, ...]] = MappingProxyType({_POSES: (32,), _TRACKERS: (44, 68)})
"""Bytes of an item, by type; other types give no reading."""
_SEGMENTS = tuple(stream_name(label) for label in FULL_BODY)
_GYRO: Mapping[str, tuple[str, Callable[[Numbers], Numbers]]] = MappingProxyType(
    {
        "": ("gyro_unknown_unit", tuple),
        "deg/s": ("gyro_rad_s", radians),
        "rad/s": ("gyro_rad_s", tuple),
    }
)


def decoder(*, gyro_unit: str = "", every: int = 1, datagrams: bool = False) -> MxtpDecoder:
    """A decoder of one sender: each segment is a device, such as `right_hand`, and each tracker, `right_hand_sensor`.

    Args:
        gyro_unit: of the angular velocity of trackers: "deg/s" or "rad/s"; "" if unknown.
        every: MVN sends one of so many samples; the readings' count is of those.
        datagrams: each call has one message, as in UDP.
    """
    return MxtpDecoder(gyro_unit, every, datagrams=datagrams)


class MxtpDecoder:
    """Messages of one sender, from datagrams or from a stream.

    Raises:
        ValueError: gyro_unit is none of the units.
    """

    def __init__(self, gyro_unit: str, every: int, *, datagrams: bool) -> None:
        if gyro_unit not in _GYRO:
            raise ValueError(f'gyro_unit is "{gyro_unit}"; expected deg/s or rad/s')
        self.damaged = 0
        self._gyro, self._every, self._datagrams = _GYRO[gyro_unit], every, datagrams
        self._samples, self._clock, self._fine = Wrapping(2**32), Wrapping(2**32), MillisecondClock()
        self._rest = b""
        self._lost = False

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings that these bytes complete, in the order of their messages."""
        if self._datagrams:
            return self._readings(data)
        self._rest += data
        found: list[Reading] = []
        while (end := self._first_message()) is not None:
            found += self._readings(self._rest[:end])
            self._lost = False
            self._rest = self._rest[end:]
        return found

    def _first_message(self) -> int | None:
        """Where the message ends with which the rest begins, after bytes that are none; None if more must come."""
        while True:
            begin = _BEGIN.search(self._rest)
            self._skip(begin.start() if begin else max(len(self._rest) - _BEGIN_BYTES + 1, 0))
            if begin is None or len(self._rest) < _HEAD.size:
                return None
            size = _HEAD.unpack_from(self._rest)[-1]
            end = _HEAD.size + size if size else _MOST_BYTES
            following = _BEGIN.search(self._rest, 1, end)
            if following is None and len(self._rest) < end:
                return None
            if following is None:
                return end
            if not size:  # before MVN 2019: the next header shows the end
                return following.start()
            self._skip(following.start())

    def _skip(self, count: int) -> None:
        self._rest = self._rest[count:]
        if count and not self._lost:
            self.damaged += 1
            self._lost = True

    def _readings(self, message: bytes) -> list[Reading]:
        if len(message) < _HEAD.size or not _BEGIN.match(message):
            self.damaged += 1
            return []
        kind, sample, _, items, time_ms, character, *_, size = _HEAD.unpack_from(message)
        if kind not in _SIZES:
            return []
        body = message[_HEAD.size :]
        width = len(body) // max(items, 1)
        if size not in (0, len(body)) or width * items != len(body) or (items and width not in _SIZES[kind]):
            self.damaged += 1
            return []
        read = self._pose if kind == _POSES else self._tracker
        place = f"{character}/" if character else ""
        found = [
            (place + name, values)
            for name, values in (read(body[at : at + width]) for at in range(0, len(body), width or 1))
            if are_sound(values)
        ]
        self.damaged += items > len(found)
        samples = self._samples.unwrapped(sample)
        clock_s = self._fine.time_s(samples, self._clock.unwrapped(time_ms) / 1e3)
        return [Reading(name, clock_s, values, samples // self._every) for name, values in found]

    def _pose(self, item: bytes) -> tuple[str, dict[str, Value]]:
        segment, *n = struct.unpack(">I7f", item)
        return _name(segment), {"position_m": tuple(n[:3]), "quat_wxyz": tuple(n[3:])}

    def _tracker(self, item: bytes) -> tuple[str, dict[str, Value]]:
        segment, *n = struct.unpack(f">I{len(item) // 4 - 1}f", item)
        values: dict[str, Value] = {
            "quat_wxyz": tuple(n[:4]),
            "earth_free_accel_m_s2": tuple(n[4:7]),
            "mag_arbitrary": tuple(n[-3:]),
        }
        if len(n) > 10:
            name, held = self._gyro
            values |= {"accel_m_s2": tuple(n[7:10]), name: held(tuple(n[10:13]))}
        return _name(segment) + SENSOR, values


def _name(segment: int) -> str:
    """The names of the body's segments as the reader of MVNX files has them; props and fingers by number."""
    return _SEGMENTS[segment - 1] if 0 < segment <= len(_SEGMENTS) else f"segment_{segment}"
