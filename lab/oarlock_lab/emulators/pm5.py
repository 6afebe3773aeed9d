"""A virtual Concept2 PM5 on which somebody rows at a steady rate.

Source: Concept2, "PM Bluetooth Smart Communication Interface Definition", revision 1.30. Messages are written from it,
apart from the decoder, so that each checks the other. Numbers are unsigned and little-endian. Order and moments are
those of monitors' traces in docs/PM5_Interface.md of Open Rowing Monitor: status on a timer, stroke data, its power and
the force curve at the end of the drive, stroke data again at the end of the recovery.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from struct import pack
from types import MappingProxyType

from bumble.device import Device

from oarlock.live.transports.radio import short
from oarlock_lab.emulators.bluetooth import Offers, Peripheral, placed, sender
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring, on_the_way
from oarlock_lab.emulators.rower import Rowing, Values

NEWTONS_PER_POUND = 4.4482216152605
WORDS_OF_A_PART = 9
# 15 is the largest number of parts that four bits hold.
MOST_WORDS = 15 * WORDS_OF_A_PART


def general_status(v: Values, is_multiplexed: bool) -> bytes:
    """0x0031, 19 bytes: a row without a target, work in progress."""
    states = bytes([1, 0, 1, 1, round(v["stroke_state"])])
    totals = _three(v["distance_m"]) + _three(0.0) + bytes([0x80, round(v["drag_factor"])])
    return _hundredths(v["elapsed_s"]) + _three(10.0 * v["distance_m"]) + states + totals


def additional_status(v: Values, is_multiplexed: bool) -> bytes:
    """0x0032, 17 bytes, or 19 with the average power."""
    pace = round(100.0 * v["pace_s_per_500_m"])
    rate, heart_rate = round(v["rate_per_min"]), round(v.get("heart_rate_per_min", 255.0))
    head = pack("<HBBHHH", round(1000.0 * v["speed_m_s"]), rate, heart_rate, pace, pace, 0)
    power = pack("<H", round(v["power_w"])) if is_multiplexed else b""
    return _hundredths(v["elapsed_s"]) + head + _three(0.0) + power + b"\x00"


def additional_status_2(v: Values, is_multiplexed: bool) -> bytes:
    """0x0033, 20 bytes, or 18 without the average power."""
    power = b"" if is_multiplexed else pack("<H", round(v["power_w"]))
    split = pack(
        "<HHHH", round(v["energy_kcal"]), round(100.0 * v["pace_s_per_500_m"]), round(v["power_w"]), 0
    )
    return _hundredths(v["elapsed_s"]) + b"\x00" + power + split + _three(0.0) + _three(0.0)


def stroke_data(v: Values, is_multiplexed: bool) -> bytes:
    """0x0035, 20 bytes, or 18 without the work."""
    drive = pack(
        "<BBH", *(round(100.0 * v[n]) for n in ("handle_travel_m", "drive_time_s", "recovery_time_s"))
    )
    forces = (round(10.0 * v[name] / NEWTONS_PER_POUND) for name in ("peak_force_n", "mean_force_n"))
    work = b"" if is_multiplexed else pack("<H", round(10.0 * v["work_j"]))
    head = _hundredths(v["elapsed_s"]) + _three(10.0 * v["distance_m"]) + drive
    boat = pack("<HHH", round(100.0 * v["distance_per_stroke_m"]), *forces)
    return head + boat + work + pack("<H", round(v["stroke_number"]))


def additional_stroke_data(v: Values, is_multiplexed: bool) -> bytes:
    """0x0036, 15 bytes, or 17 with the work."""
    body = pack("<HHH", round(v["power_w"]), round(v["energy_rate_kcal_per_h"]), round(v["stroke_number"]))
    work = pack("<H", round(10.0 * v["work_j"])) if is_multiplexed else b""
    return _hundredths(v["elapsed_s"]) + body + _three(0.0) + _three(0.0) + work


def additional_status_3(v: Values, is_multiplexed: bool) -> bytes:
    """0x003E, 12 bytes: in a workout."""
    return bytes([2, 0, 1, *bytes(9)])


def force_curve(force_n: Sequence[float]) -> list[bytes]:
    """0x003D, the parts of a curve: each begins with (parts << 4 | words) and its index; words are whole pounds."""
    pounds = [round(force / NEWTONS_PER_POUND) for force in force_n[:MOST_WORDS]]
    cut = [pounds[at : at + WORDS_OF_A_PART] for at in range(0, len(pounds), WORDS_OF_A_PART)]
    return [
        bytes([len(cut) << 4 | len(words), index]) + pack(f"<{len(words)}H", *words)
        for index, words in enumerate(cut)
    ]


MESSAGES: Mapping[int, Callable[[Values, bool], bytes]] = MappingProxyType(
    {
        0x31: general_status,
        0x32: additional_status,
        0x33: additional_status_2,
        0x35: stroke_data,
        0x36: additional_stroke_data,
        0x3E: additional_status_3,
    }
)
"""Characteristic -> its bytes from SI values, alone or (True) behind the first byte of the multiplexed one."""


def _hundredths(seconds: float) -> bytes:
    return _three(100.0 * seconds)


def _three(value: float) -> bytes:
    return (round(value) % (1 << 24)).to_bytes(3, "little")


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
