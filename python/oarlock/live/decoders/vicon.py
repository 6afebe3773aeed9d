"""Decodes the UDP object stream of Vicon Tracker: places of rigid objects by optical markers, port 51001 by default.

Source: the layout in several public receivers that agree (a frame number, a count of items, and for each an id, a
size, a name of 24 bytes, three translations in mm and three rotations in rad as float64; little-endian); the
vendor's document was not at hand. The order of the rotations could not be verified: they are passed on as sent.
Places of single markers are not in this stream: send them as JSON lines.
"""

from __future__ import annotations

import struct

from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.decoders.quantities import are_sound
from oarlock.live.decoders.wrapping import Wrapping
from oarlock.live.reading import Reading

_HEAD = struct.Struct("<IB")
_ITEM = struct.Struct("<BH")
_OBJECT = struct.Struct("<24s6d")
_OBJECT_ID = 0


def decoder(*, rate_hz: float = 0.0) -> MessageDecoder:
    """A decoder of one Tracker: a reading for each object that it sees; its name is the device.

    Args:
        rate_hz: of the cameras' frames, whose count then is the readings' clock; 0 if unknown: they have none.
    """
    frames = Wrapping(2**32)
    return MessageDecoder(lambda data: _readings(data, frames, rate_hz), b"")


def _readings(data: bytes, frames: Wrapping, rate_hz: float) -> list[Reading] | None:
    try:
        frame, items = _HEAD.unpack_from(data)
        found, at = [], _HEAD.size
        for _ in range(items):
            kind, size = _ITEM.unpack_from(data, at)
            at += _ITEM.size
            if kind == _OBJECT_ID:
                if size != _OBJECT.size:
                    return None
                found.append(_OBJECT.unpack_from(data, at))
            at += size
    except struct.error:
        return None
    if at > len(data):
        return None
    # An object that the cameras do not see has only zeros.
    seen = [_reading(name, numbers) for name, *numbers in found if any(numbers)]
    if not all(are_sound(one.values) for one in seen):
        return None
    count = frames.unwrapped(frame)
    clock_s = count / rate_hz if rate_hz > 0.0 else None
    return [Reading(one.device, clock_s, one.values, count) for one in seen]


def _reading(name: bytes, numbers: list[float]) -> Reading:
    place = tuple(value / 1000.0 for value in numbers[:3])
    device = name.partition(b"\0")[0].decode("utf-8", "replace")
    return Reading(device, None, {"position_m": place, "rotation_xyz_rad": tuple(numbers[3:])})
