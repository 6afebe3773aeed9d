"""Readings from JSON objects, for the decoder of lines: of sensors that somebody built, or of markers.

Of a sensor, names of quantities as `Reading` has them, and of the sender what it can tell: `{"device": "hand",
"t_us": 2500, "seq": 1, "gyro_rad_s": [0, 0, 0.02], "accel_m_s2": [0.1, 0, 9.8]}`; `clock_s` in place of `t_us` for
seconds that do not wrap. Of markers, `{"markers": {"left_wrist": [0.1, 0.2, 0.9]}, "frame": 12, "t_us": 2500}`, in
m.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import NoReturn

from oarlock.live.decoders.quantities import are_sound
from oarlock.live.decoders.wrapping import REGISTERS, Wrapping
from oarlock.live.reading import Reading, Value

MOST_DEVICES = 64
"""Of one sender; more names than these are damage."""


@dataclass
class MicrosecondCounter:
    """The microseconds and the count of one device, unwrapped: they may wrap at 2^32, the count also earlier."""

    time_us: Wrapping = field(default_factory=lambda: Wrapping(2**32))
    count: Wrapping = field(default_factory=lambda: Wrapping(*REGISTERS))


class JsonObjects:
    """JSON objects of one sender to readings."""

    def __init__(self) -> None:
        self._clocks: dict[str, MicrosecondCounter] = {}

    def readings(self, line: bytes) -> list[Reading] | None:
        """The readings of one object; None if it is damaged."""
        try:
            told = json.loads(line, parse_constant=_no_number)
            markers = told.pop("markers", None)
            if markers is not None:
                return self._markers(markers, told)
            device = told.pop("device", "")
            return None if not isinstance(device, str) else [self._reading(device, told, "seq")]
        except (ValueError, RecursionError, AttributeError, OverflowError):
            return None

    def _markers(self, markers: dict[str, object], told: dict[str, object]) -> list[Reading]:
        return [
            self._reading(name, {**told, "position_m": place}, "frame")
            for name, place in markers.items()
            if place is not None
        ]

    def _reading(self, device: str, told: dict[str, object], counter: str) -> Reading:
        numbers = {name: _whole(told[name]) for name in ("t_us", counter) if told.get(name) is not None}
        clock_s = _value(told["clock_s"]) if told.get("clock_s") is not None else None
        stamps = ("t_us", "clock_s", counter)
        values = {n: _value(v) for n, v in told.items() if n not in stamps and v is not None}
        if not values or not are_sound(values) or not isinstance(clock_s, float | None):
            raise ValueError("no quantities")
        clock = self._clock(device)
        if "t_us" in numbers:
            clock_s = clock.time_us.unwrapped(numbers["t_us"]) / 1e6
        count = clock.count.unwrapped(numbers[counter]) if counter in numbers else None
        return Reading(device, clock_s, values, count)

    def _clock(self, device: str) -> MicrosecondCounter:
        if device not in self._clocks and len(self._clocks) >= MOST_DEVICES:
            raise ValueError("too many devices")
        return self._clocks.setdefault(device, MicrosecondCounter())


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**53:
        raise ValueError("no count")
    return value


def _value(value: object) -> Value:
    if isinstance(value, str):
        return value
    if isinstance(value, list) and value:
        return tuple(_number(one) for one in value)
    return _number(value)


def _number(value: object) -> float:
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError("no number")
    return float(value)


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)
