"""A virtual Concept2 PM5 on which somebody rows at a steady rate; its messages are in `pm5_messages`.

Order and moments are those of monitors' traces in docs/PM5_Interface.md of Open Rowing Monitor: status on a
timer, stroke data, its power and the force curve at the end of the drive, stroke data again at the end of the
recovery.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator

from bumble.device import Device

from oarlock.live.emulators.bluetooth import placed, sender
from oarlock.live.emulators.emulated import DeviceMessage, Emulated, Wiring
from oarlock.live.emulators.on_the_way import on_the_way
from oarlock.live.emulators.peripheral import Offers, Peripheral
from oarlock.live.emulators.pm5_messages import MESSAGES, force_curve
from oarlock.live.emulators.rower import Rowing, Values
from oarlock.live.transports.radio import short

_UUID = "ce06{:04x}-43e5-11e4-916c-0800200c9a66"
_NOTIFIES = (0x31, 0x32, 0x33, 0x35, 0x36, 0x3D, 0x3E, 0x80)
_STATUS = (0x31, 0x32, 0x33, 0x3E)
_FORCE_CURVE, _MULTIPLEXED, _STATUS_RATE = 0x3D, 0x80, 0x34
_PERIODS_S = (1.0, 0.5, 0.25, 0.1)

NAME = "PM5 430000000"
_UNIT = "pm5"

Sent = Callable[[int, Values | tuple[float, ...]], None]
Moment = tuple[float, tuple[int, ...]]
OnWay = Callable[[Iterable[Moment]], Iterator[tuple[float, float, tuple[int, ...]]]]


def _moments(rowing: Rowing, period_s: Callable[[], float]) -> Iterator[Moment]:
    """When which characteristics notify, without end.

    Args:
        rowing: the strokes.
        period_s: gives the time between two messages of status, which can change.
    """
    status_s = 0.0
    for event_s, numbers in _events(rowing):
        while status_s <= event_s:
            yield status_s, _STATUS
            status_s += period_s()
        yield event_s, numbers


def _parts(rowing: Rowing, number: int, time_s: float, is_multiplexed: bool) -> list[bytes]:
    """The notifications of a characteristic."""
    if number == _FORCE_CURVE:
        return force_curve(rowing.force_n())
    return [MESSAGES[number](rowing.values(time_s), is_multiplexed)]


def _at_once(moments: Iterable[Moment]) -> Iterator[tuple[float, float, tuple[int, ...]]]:
    """Nothing delays what is sent."""
    for time_s, numbers in moments:
        yield time_s, time_s, numbers


def _events(rowing: Rowing) -> Iterator[Moment]:
    """The ends of drives and recoveries without end: time, and the characteristics that notify."""
    number = 0
    while True:
        yield number * rowing.stroke_s + rowing.drive_s, (0x35, 0x36, _FORCE_CURVE)
        number += 1
        yield number * rowing.stroke_s - 1e-6, (0x35,)  # still of the stroke that ends


def messages(emulated: Emulated, rowing: Rowing | None = None) -> Iterator[DeviceMessage]:
    """What a monitor notifies whose status is asked for each 250 ms, each characteristic by itself."""
    rower = rowing or Rowing()
    for due_s, time_s, numbers in on_the_way(emulated, _moments(rower, lambda: _PERIODS_S[2])):
        for number in numbers:
            for data in _parts(rower, number, time_s, False):
                yield DeviceMessage(due_s, _UNIT, data, short(_UUID.format(number)))


def wiring(emulated: Emulated) -> Wiring:
    """It feeds no sensor."""
    return Wiring("pm5", {_UNIT: sender(_UNIT)}, {})


async def emulate(emulated: Emulated) -> None:
    """Row at the place's adapter until the recording's time is over, or it is cancelled."""
    async with placed(emulated) as device:
        monitor = _Monitor(device, Rowing(), NAME, lambda number, values: None)
        await monitor.run(1.0, lambda moments: on_the_way(emulated, moments))


async def run(
    device: Device,
    rowing: Rowing | None = None,
    *,
    name: str = NAME,
    speed: float = 1.0,
    sent: Sent = lambda number, values: None,
) -> None:
    """Be a PM5 until cancelled.

    Args:
        device: of `air`, on a link of this process or on an adapter.
        rowing: the strokes.
        name: that it advertises.
        speed: 2.0 rows twice as fast as the clock, with the same values.
        sent: called with the number of the characteristic and its values, or forces, when they have been notified.
    """
    await _Monitor(device, rowing or Rowing(), name, sent).run(speed)


class _Monitor:
    def __init__(self, device: Device, rowing: Rowing, name: str, sent: Sent) -> None:
        offers = Offers([_UUID.format(n) for n in _NOTIFIES], [_UUID.format(_STATUS_RATE)])
        self._peripheral = Peripheral(device, name, {_UUID.format(0x30): offers}, self._written)
        self._rowing, self._sent = rowing, sent
        self._period_s = _PERIODS_S[1]

    async def run(self, speed: float, on_way: OnWay = _at_once) -> None:
        async with self._peripheral.there():
            loop = asyncio.get_running_loop()
            began_s = loop.time()
            for due_s, time_s, numbers in on_way(_moments(self._rowing, lambda: self._period_s)):
                await asyncio.sleep(began_s + due_s / speed - loop.time())
                for number in numbers:
                    await self._notify(number, time_s)

    async def _notify(self, number: int, time_s: float) -> None:
        """By the own characteristic if somebody has subscribed to it, else by the multiplexed one."""
        is_multiplexed = not self._peripheral.is_subscribed(_UUID.format(number))
        place = _UUID.format(_MULTIPLEXED if is_multiplexed else number)
        head = bytes([number]) if is_multiplexed else b""
        if not self._peripheral.is_subscribed(place):
            return
        for data in _parts(self._rowing, number, time_s, is_multiplexed):
            await self._peripheral.notify(place, head + data)
        is_curve = number == _FORCE_CURVE
        self._sent(number, self._rowing.force_n() if is_curve else self._rowing.values(time_s))

    def _written(self, uuid: str, data: bytes) -> None:
        if len(data) == 1 and data[0] < len(_PERIODS_S):
            self._period_s = _PERIODS_S[data[0]]
