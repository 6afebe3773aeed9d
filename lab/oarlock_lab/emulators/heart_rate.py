"""A virtual heart rate belt. Source of its message: Bluetooth SIG, "Heart Rate Service 1.0"."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from itertools import count
from struct import pack

from bumble.device import Device

from oarlock_lab.emulators.bluetooth import Offers, Peripheral, notify, placed, sender
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, on_the_way

NAME = "Oarlock belt"
_UNIT = "belt"
_SERVICE, _MEASUREMENT = "180D", "2A37"
# Contact is felt and there, intervals follow.
_FLAGS = 0b1_0110


def message(rate_per_min: float, rr_s: tuple[float, ...]) -> bytes:
    """A measurement with intervals between beats, of 1/1024 s."""
    return pack(f"<BB{len(rr_s)}H", _FLAGS, round(rate_per_min), *(round(1024.0 * rr) for rr in rr_s))


def messages(
    emulated: Emulated, rate_per_min: float = 150.0, swing_per_min: float = 5.0
) -> Iterator[DeviceMessage]:
    """A measurement a second."""
    moments = ((float(second), one) for second, one in enumerate(_beats(rate_per_min, swing_per_min), 1))
    for due_s, _, (rate, rr_s) in on_the_way(emulated, moments):
        yield DeviceMessage(due_s, _UNIT, message(rate, rr_s), _MEASUREMENT)


def wiring(emulated: Emulated) -> Wiring:
    """It feeds no sensor."""
    return Wiring("heart_rate", {_UNIT: sender(_UNIT)}, {})


async def emulate(emulated: Emulated) -> None:
    """Send at the place's adapter until the recording's time is over, or it is cancelled."""
    async with placed(emulated) as device:
        peripheral = _peripheral(device, NAME)
        async with peripheral.there():
            await notify(peripheral, messages(emulated))


async def run(
    device: Device,
    *,
    rate_per_min: float = 150.0,
    swing_per_min: float = 5.0,
    name: str = NAME,
    speed: float = 1.0,
    sent: Callable[[float, tuple[float, ...]], None] = lambda rate_per_min, rr_s: None,
) -> None:
    """Be a belt until cancelled: a message a second.

    Args:
        device: of `air`, on a link of this process or on an adapter.
        rate_per_min: the mean rate.
        swing_per_min: by how much it goes up and down, once in 30 s.
        name: that it advertises.
        speed: 2.0 sends twice as fast.
        sent: called with rate and intervals of each message that was notified.
    """
    peripheral = _peripheral(device, name)
    async with peripheral.there():
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        for second, (rate, rr_s) in enumerate(_beats(rate_per_min, swing_per_min), 1):
            await asyncio.sleep(began_s + second / speed - loop.time())
            if await peripheral.notify(_MEASUREMENT, message(rate, rr_s)):
                sent(rate, rr_s)


def _peripheral(device: Device, name: str) -> Peripheral:
    return Peripheral(device, name, {_SERVICE: Offers([_MEASUREMENT])})


def _beats(rate_per_min: float, swing_per_min: float) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Rate and intervals of the beats in each second, without end."""
    beat_s = 0.0
    for second in count(1):
        rate = rate_per_min + swing_per_min * math.sin(2.0 * math.pi * second / 30.0)
        beats = max(0, int((second - beat_s) * rate / 60.0))
        beat_s += beats * 60.0 / rate
        yield rate, (60.0 / rate,) * beats
