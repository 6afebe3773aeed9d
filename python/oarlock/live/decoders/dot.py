"""Decodes Movella DOT (Xsens DOT) over Bluetooth: measurement payloads, battery, answers.

Source: Movella, "Movella DOT BLE Services Specification" (XD0506P, revision C); the magnetometer's scale 1/4096
(arbitrary units) from two public clients. High-fidelity modes (1, 17, 25) are decoded by the vendor's software
alone. Packets have no counter: a loss shows as a gap of the clock, which wraps every 71.6 minutes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType

from oarlock.formats.devices.dot import OUT_OF_RANGE
from oarlock.live.decoders.dot_messages import message_of
from oarlock.live.decoders.quantities import are_sound, quat_from_roll_pitch_yaw, radians
from oarlock.live.decoders.wrapping import Wrapping
from oarlock.live.reading import Reading, Value

Numbers = tuple[float, ...]
_BATTERY, _ANSWER = "3001", "7003"
_PAYLOADS = ("2002", "2003", "2004")
_MAG_SCALE = 4096.0

_PARTS: Mapping[str, tuple[str, Callable[[Numbers], dict[str, Value]]]] = MappingProxyType(
    {
        "quat": ("4f", lambda n: {"quat_wxyz": n}),
        "euler": ("3f", lambda n: {"quat_wxyz": quat_from_roll_pitch_yaw(n)}),
        "free": ("3f", lambda n: {"earth_free_accel_m_s2": n}),
        "accel": ("3f", lambda n: {"accel_m_s2": n}),
        "gyro": ("3f", lambda n: {"gyro_rad_s": radians(n)}),
        "mag": ("3h", lambda n: {"mag_arbitrary": tuple(value / _MAG_SCALE for value in n)}),
        "turn": ("4f", lambda n: {"turn_wxyz": n}),
        "speed": ("3f", lambda n: {"velocity_change_m_s": n}),
        "status": ("HBB", lambda n: _status(n)),
    }
)
_MODES: Mapping[int, tuple[str, ...]] = MappingProxyType(
    {
        2: ("quat", "free", "status"),
        3: ("quat", "free"),
        4: ("euler",),
        5: ("quat",),
        6: ("free",),
        7: ("euler", "free", "status"),
        16: ("euler", "free"),
        18: ("turn", "speed", "mag"),
        19: ("turn", "speed"),
        20: ("accel", "gyro", "mag"),
        21: ("accel", "gyro"),
        22: ("euler", "free", "gyro"),
        23: ("euler", "free", "mag"),
        24: ("quat", "gyro"),
        26: ("quat", "accel", "gyro"),
    }
)
"""What follows the time stamp, by measurement mode."""


def decoder(*, mode: int = 20) -> DotDecoder:
    """A decoder of one unit.

    Args:
        mode: its measurement mode: 20 and 21 are raw readings with and without magnetometer.
    """
    return DotDecoder(mode)


class DotDecoder:
    """Notifications of one unit; `channel` is the UUID of their characteristic, or "" for measurements.

    Raises:
        ValueError: the mode is one that only the vendor's software decodes, or none.
    """

    def __init__(self, mode: int) -> None:
        if mode not in _MODES:
            raise ValueError(f"mode is {mode}; expected one of {', '.join(map(str, _MODES))}")
        self.damaged = 0
        self._parts = [_PARTS[name] for name in _MODES[mode]]
        self._layout = struct.Struct("<I" + "".join(form for form, _ in self._parts))
        self._clock = Wrapping(2**32)

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The reading of a notification; none for characteristics that have no readings."""
        which = channel.partition("-")[0][-4:].lower()
        if which and which not in (*_PAYLOADS, _BATTERY, _ANSWER):
            return []
        found = self._battery(data) if which == _BATTERY else self._answer(data) if which == _ANSWER else None
        found = found if which in (_BATTERY, _ANSWER) else self._payload(data)
        if found is None:
            self.damaged += 1
        return [] if found is None else [found]

    def _payload(self, data: bytes) -> Reading | None:
        size = self._layout.size
        # A characteristic is longer than the payload: zeros follow. Others show that the unit is in another mode.
        if len(data) < size or any(data[size:]):
            return None
        ticks, *numbers = self._layout.unpack_from(data)
        values: dict[str, Value] = {}
        for form, read in self._parts:
            count = 3 if form == "HBB" else int(form[0])
            values |= read(tuple(numbers[:count]))
            del numbers[:count]
        return Reading("", self._clock.unwrapped(ticks) / 1e6, values) if are_sound(values) else None

    def _battery(self, data: bytes) -> Reading | None:
        if len(data) < 2 or data[0] > 100:
            return None
        return Reading("", None, {"battery_percent": float(data[0]), "charging": float(data[1])})

    def _answer(self, data: bytes) -> Reading | None:
        found = message_of(data)
        return None if found is None else Reading("", None, {"answer": f"{found[0]:02x} {found[1].hex(' ')}"})


def _status(numbers: Numbers) -> dict[str, Value]:
    """Names of the axes that were beyond their range, if any."""
    beyond = " ".join(name for bit, name in enumerate(OUT_OF_RANGE) if int(numbers[0]) >> bit & 1)
    return {"out_of_range": beyond} if beyond else {}
