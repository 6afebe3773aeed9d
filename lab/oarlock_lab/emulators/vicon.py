"""Emulates the UDP object stream of Vicon Tracker: places of objects in mm, little-endian.

Source: the layout in several public receivers that agree: number of the frame, count of items, and for each an id, a
size, a name of 24 bytes, three translations and three rotations as float64. There is no clock; frames are counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from struct import pack

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, frames

_UNIT = "vicon"
_OBJECT, _SIZE, _NAME_BYTES = 0, 72, 24


def datagram(frame: int, places_m: Sequence[tuple[str, Sequence[float]]]) -> bytes:
    """A frame with the places of its objects, which do not turn."""
    items = (
        pack(f"<BH{_NAME_BYTES}s6d", _OBJECT, _SIZE, name.encode(), *(1e3 * x for x in place), 0.0, 0.0, 0.0)
        for name, place in places_m
    )
    return pack("<IB", frame % 2**32, len(places_m)) + b"".join(items)


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A datagram for each frame."""
    for frame in frames(emulated):
        places = list(_places(frame))
        yield DeviceMessage(frame[0].due_s, _UNIT, datagram(frame[0].count, places))


def wiring(emulated: Emulated) -> Wiring:
    """Objects have the names of their streams; the rate of the frames turns their count into a clock."""
    streams = {name: (_UNIT, name[:_NAME_BYTES]) for name in emulated.recording.names}
    rate_hz = round(max(stream.rate_hz for stream in emulated.recording.streams), 3)
    return Wiring("vicon", senders(emulated.place, "vicon", [_UNIT]), streams, {"rate_hz": rate_hz})


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await carry(emulated, [_UNIT], messages(emulated))


def _places(frame: list[Delivery]) -> Iterator[tuple[str, tuple[float, ...]]]:
    for one in frame:
        for place in one.values.values():
            if isinstance(place, tuple):
                yield one.device, place
