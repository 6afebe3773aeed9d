"""A virtual Concept2 PM5 on which somebody rows at a steady rate; its messages are in `pm5_messages`.

Order and moments are those of monitors' traces in docs/PM5_Interface.md of Open Rowing Monitor: status on a
timer, stroke data, its power and the force curve at the end of the drive, stroke data again at the end of the
recovery.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from bumble.device import Device

from oarlock.live.emulators.peripheral import Offers, Peripheral
from oarlock.live.emulators.pm5_messages import MESSAGES, Values, force_curve

_UUID = "ce06{:04x}-43e5-11e4-916c-0800200c9a66"
_NOTIFIES = (0x31, 0x32, 0x33, 0x35, 0x36, 0x3D, 0x3E, 0x80)
_STATUS = (0x31, 0x32, 0x33, 0x3E)
_FORCE_CURVE, _MULTIPLEXED, _STATUS_RATE = 0x3D, 0x80, 0x34
_PERIODS_S = (1.0, 0.5, 0.25, 0.1)
_DRIVING, _RECOVERING = 2.0, 4.0
# Concept2 gives pace and power as P = 2.8 v^3.
_DRAG_W_S3_M3 = 2.8

Sent = Callable[[int, Values | tuple[float, ...]], None]


@dataclass(frozen=True)
class Rowing:
    """Equal strokes.

    Args:
        rate_per_min: strokes a minute.
        drive_s: duration of the drive, shorter than a stroke.
        handle_travel_m: of the handle in the drive.
        peak_force_n: of the handle; the curve is half a sine.
    """

    rate_per_min: float = 24.0
    drive_s: float = 0.8
    handle_travel_m: float = 1.4
    peak_force_n: float = 600.0

    @property
    def stroke_s(self) -> float:
        """Duration of a stroke."""
        return 60.0 / self.rate_per_min

    def force_n(self) -> tuple[float, ...]:
        """The force curve: a value each 10 ms."""
        count = round(self.drive_s / 0.01)
        return tuple(self.peak_force_n * math.sin(math.pi * (i + 0.5) / count) for i in range(count))

    def values(self, time_s: float) -> Values:
        """What the monitor shows at a time since the first drive began."""
        number, phase_s = divmod(time_s, self.stroke_s)
        mean_force_n = 2.0 / math.pi * self.peak_force_n
        work_j = mean_force_n * self.handle_travel_m
        speed_m_s = math.cbrt(work_j / self.stroke_s / _DRAG_W_S3_M3)
        power_w = work_j / self.stroke_s
        return {
            "elapsed_s": time_s,
            "distance_m": speed_m_s * time_s,
            "stroke_state": _DRIVING if phase_s < self.drive_s else _RECOVERING,
            "drag_factor": 120.0,
            "speed_m_s": speed_m_s,
            "pace_s_per_500_m": 500.0 / speed_m_s,
            "rate_per_min": self.rate_per_min,
            "power_w": power_w,
            "energy_kcal": power_w * time_s / 1000.0,
            "energy_rate_kcal_per_h": 3.6 * power_w,
            "handle_travel_m": self.handle_travel_m,
            "drive_time_s": self.drive_s,
            "recovery_time_s": self.stroke_s - self.drive_s,
            "distance_per_stroke_m": speed_m_s * self.stroke_s,
            "peak_force_n": self.peak_force_n,
            "mean_force_n": mean_force_n,
            "work_j": work_j,
            "stroke_number": number + 1.0,
        }

    def events(self) -> Iterator[tuple[float, tuple[int, ...]]]:
        """The ends of drives and recoveries without end: time, and the characteristics that notify."""
        number = 0
        while True:
            yield number * self.stroke_s + self.drive_s, (0x35, 0x36, _FORCE_CURVE)
            number += 1
            yield number * self.stroke_s - 1e-6, (0x35,)  # still of the stroke that ends


async def run(
    device: Device,
    rowing: Rowing | None = None,
    *,
    name: str = "PM5 430000000",
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

    async def run(self, speed: float) -> None:
        async with self._peripheral.there():
            loop = asyncio.get_running_loop()
            began_s = loop.time()
            for time_s, numbers in self._moments():
                await asyncio.sleep(began_s + time_s / speed - loop.time())
                for number in numbers:
                    await self._notify(number, time_s)

    def _moments(self) -> Iterator[tuple[float, tuple[int, ...]]]:
        """When which characteristics notify, without end."""
        status_s = 0.0
        for event_s, numbers in self._rowing.events():
            while status_s <= event_s:
                yield status_s, _STATUS
                status_s += self._period_s
            yield event_s, numbers

    async def _notify(self, number: int, time_s: float) -> None:
        """By the own characteristic if somebody has subscribed to it, else by the multiplexed one."""
        is_multiplexed = not self._peripheral.is_subscribed(_UUID.format(number))
        place = _UUID.format(_MULTIPLEXED if is_multiplexed else number)
        head = bytes([number]) if is_multiplexed else b""
        if not self._peripheral.is_subscribed(place):
            return
        values: Values | tuple[float, ...] = self._rowing.values(time_s)
        if number == _FORCE_CURVE:
            values = self._rowing.force_n()
            messages = force_curve(values)
        else:
            messages = [MESSAGES[number](self._rowing.values(time_s), is_multiplexed)]
        for message in messages:
            await self._peripheral.notify(place, head + message)
        self._sent(number, values)

    def _written(self, uuid: str, data: bytes) -> None:
        if len(data) == 1 and data[0] < len(_PERIODS_S):
            self._period_s = _PERIODS_S[data[0]]
