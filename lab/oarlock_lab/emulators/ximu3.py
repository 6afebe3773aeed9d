"""Emulates x-IMU3 units: binary messages, or text, by UDP, TCP or serial line, and what they broadcast in a network.

Source: x-io Technologies, x-IMU3 User Manual, "Communication protocol" and "Network announcement". Numbers are
little-endian, stamps in us. A message ends with LF, which is stuffed where it occurs inside. The magnetometer counts
fields of the Earth, here of 50 uT, and measures 20 times a second.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import socket
from collections.abc import Callable, Iterator, Sequence
from struct import pack
from typing import cast

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, port_of, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring

ANNOUNCED_AT = 10000
"""UDP port."""
BATTERY_PERCENT = 88.0
_BATTERY_S, _MAG_S = 5.0, 0.05
_EARTH_FIELD_UT, _GRAVITY_M_S2 = 50.0, 9.80665

Numbers = Sequence[float]
Write = Callable[[str, int, Numbers], bytes]


def binary(letter: str, stamp_us: int, numbers: Numbers) -> bytes:
    """A binary message: the letter with its highest bit set, stamp, float32."""
    plain = bytes([0x80 | ord(letter)]) + pack(f"<Q{len(numbers)}f", stamp_us, *numbers)
    return stuffed(plain) + b"\n"


def text(letter: str, stamp_us: int, numbers: Numbers) -> bytes:
    """A message of text with four decimals."""
    return ",".join([letter, str(stamp_us), *(f"{n:.4f}" for n in numbers)]).encode() + b"\n"


def stuffed(plain: bytes) -> bytes:
    """Bytes without LF: DB begins a pair that stands for one of the two."""
    return plain.replace(b"\xdb", b"\xdb\xdd").replace(b"\n", b"\xdb\xdc")


def announcement(emulated: Emulated, number: int) -> bytes:
    """What a unit broadcasts each second; its ports are as the unit sees them."""
    place = emulated.place
    told = {
        "sync": 0,
        "name": emulated.recording.names[number],
        "sn": f"EEEE{number:04X}",
        "ip": place.host,
        "port": port_of(place, number),
        "send": place.port,
        "receive": port_of(place, number),
        "rssi": 100,
        "battery": round(BATTERY_PERCENT),
        "status": 0,
    }
    return json.dumps(told, separators=(",", ":")).encode()


def messages(emulated: Emulated, write: Write = binary) -> Iterator[DeviceMessage]:
    """Inertial messages of each unit; of its magnetometer and battery as often as a unit sends those."""
    due_s: dict[tuple[str, str], float] = {}
    for delivery in emulated.deliveries():
        for letter, every_s, numbers in _told(delivery):
            key = (delivery.device, letter)
            # A half of the interval of samples is far below 1 ms.
            if delivery.clock_s > due_s.get(key, -math.inf) - 1e-3:
                due_s[key] = delivery.clock_s + every_s
                data = write(letter, round(1e6 * delivery.clock_s), numbers)
                yield DeviceMessage(delivery.due_s, delivery.device, data)


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a unit of its own; the magnetometer's unit is not uT."""
    names = emulated.recording.names
    streams = {name: (name, "") for name in names}
    return Wiring("ximu3", senders(emulated.place, "ximu3", names), streams, {}, ("gyro_rad_s", "accel_m_s2"))


async def emulate(emulated: Emulated, write: Write = binary) -> None:
    """Send until the movement ends, or it is cancelled; commands are acknowledged and change nothing."""
    announcing = asyncio.ensure_future(_announce(emulated))
    try:
        await carry(emulated, emulated.recording.names, messages(emulated, write), lambda unit, data: data)
    finally:
        announcing.cancel()


def _told(delivery: Delivery) -> Iterator[tuple[str, float, Numbers]]:
    """Letter, interval and numbers of what a unit can send at this time."""
    values = cast("dict[str, tuple[float, ...]]", delivery.values)
    if "gyro_rad_s" in values and "accel_m_s2" in values:
        rates = [math.degrees(rate) for rate in values["gyro_rad_s"]]
        yield "I", 0.0, [*rates, *(force / _GRAVITY_M_S2 for force in values["accel_m_s2"])]
    if "mag_ut" in values:
        yield "M", _MAG_S, [field / _EARTH_FIELD_UT for field in values["mag_ut"]]
    yield "B", _BATTERY_S, [BATTERY_PERCENT, 4.1, 0.0]


async def _announce(emulated: Emulated) -> None:
    if emulated.place.transport == "serial":
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        while True:
            for number in range(len(emulated.recording.names)):
                # Without a network nobody can be told.
                with contextlib.suppress(OSError):
                    sender.sendto(announcement(emulated, number), (emulated.place.host, ANNOUNCED_AT))
            await asyncio.sleep(1.0)
