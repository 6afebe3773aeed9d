"""Emulates the network stream of Xsens MVN: orientations of segments (type 02) and readings of trackers (type 23).

Source: Xsens, "MVN real-time network streaming protocol specification", MV0305P revision N; items of type 23 with 68
bytes as open parsers have them. Numbers are big-endian. The time code counts whole milliseconds. Angular velocity is
sent in deg/s; the specification does not say the unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from struct import pack
from typing import cast

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, frames

SEGMENTS = (
    *("pelvis", "l5", "l3", "t12", "t8", "neck", "head"),
    *("right_shoulder", "right_upper_arm", "right_fore_arm", "right_hand"),
    *("left_shoulder", "left_upper_arm", "left_fore_arm", "left_hand"),
    *("right_upper_leg", "right_lower_leg", "right_foot", "right_toe"),
    *("left_upper_leg", "left_lower_leg", "left_foot", "left_toe"),
)
"""In the order of their numbers, which begin with 1."""
_UNIT = "mvn"
_POSES, _TRACKERS = b"MXTP02", b"MXTP23"
_ONLY_DATAGRAM = 0x80
_EARTH_FIELD_UT = 50.0
_UNTURNED, _NOTHING = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def datagram(kind: bytes, sample: int, time_s: float, items: Sequence[bytes]) -> bytes:
    """Header of 24 bytes, and the items."""
    body = b"".join(items)
    counts = (sample % 2**32, _ONLY_DATAGRAM, len(items), round(1e3 * time_s) % 2**32)
    return kind + pack(">IBBIBBBB2xH", *counts, 0, len(SEGMENTS), 0, 0, len(body)) + body


def pose(segment: int, quat_wxyz: Sequence[float], position_m: Sequence[float] = _NOTHING) -> bytes:
    """An item of type 02."""
    return pack(">I7f", segment, *position_m, *quat_wxyz)


def tracker(
    segment: int, gyro_rad_s: Sequence[float], accel_m_s2: Sequence[float], mag_ut: Sequence[float]
) -> bytes:
    """An item of type 23 of a tracker whose orientation is not known."""
    rates = (math.degrees(rate) for rate in gyro_rad_s)
    fields = (field / _EARTH_FIELD_UT for field in mag_ut)
    return pack(">I16f", segment, *_UNTURNED, *_NOTHING, *accel_m_s2, *rates, *fields)


def segments(names: Sequence[str]) -> dict[str, int]:
    """Stream -> its segment: the one with its name, else the first that is free."""
    found = {name: SEGMENTS.index(name) + 1 for name in names if name in SEGMENTS}
    free = [number for number in range(1, len(SEGMENTS) + 1) if number not in found.values()]
    others = [name for name in names if name not in found]
    return found | dict(zip(others, free, strict=False))


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A datagram of each type that has readings, at each time."""
    number = segments(emulated.recording.names)
    for frame in frames(emulated):
        for kind, items in _items(frame, number):
            first = frame[0]
            yield DeviceMessage(first.due_s, _UNIT, datagram(kind, first.count, first.clock_s, items))


def wiring(emulated: Emulated) -> Wiring:
    """Trackers have the name of their segment and `_sensor`."""
    number = segments(emulated.recording.names)
    streams = {
        stream.name: (
            _UNIT,
            SEGMENTS[number[stream.name] - 1] + ("_sensor" if stream.kind == "imu" else ""),
        )
        for stream in emulated.recording.streams
        if stream.name in number
    }
    own = senders(emulated.place, "mvn", [_UNIT])
    return Wiring("mvn", own, streams, {"gyro_unit": "deg/s"}, ("gyro_rad_s", "accel_m_s2"))


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await carry(emulated, [_UNIT], messages(emulated))


def _items(frame: list[Delivery], number: dict[str, int]) -> Iterator[tuple[bytes, list[bytes]]]:
    poses, trackers = [], []
    for one in (one for one in frame if one.device in number):
        values = cast("dict[str, tuple[float, ...]]", one.values)
        if "quat_wxyz" in values:
            poses.append(pose(number[one.device], values["quat_wxyz"]))
        else:
            measured = (values.get(name, _NOTHING) for name in ("gyro_rad_s", "accel_m_s2", "mag_ut"))
            trackers.append(tracker(number[one.device], *measured))
    yield from ((kind, items) for kind, items in ((_POSES, poses), (_TRACKERS, trackers)) if items)
