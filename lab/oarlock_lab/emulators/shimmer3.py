"""Emulates Shimmer3 units with LogAndStream firmware: a serial line that answers commands and streams after `start`.

Sources: the protocol as pyshimmer documents it. Calibration as units come from the factory, with ideal axes: low-noise
accelerometer 83 counts per m/s2 around 2047 of 4096, gyroscope 65.5 counts per deg/s, magnetometer 1100 counts per
gauss. The clock counts 1/32768 s in 24 bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from struct import pack
from typing import cast

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring

TICKS_HZ = 32768
Numbers = Sequence[float]
_ACK = b"\xff"
_CHANNELS = bytes([0, 1, 2, 0x0A, 0x0B, 0x0C, 7, 8, 9])
"""Low-noise accelerometer, gyroscope, magnetometer."""
_ACCEL_PER_M_S2, _ACCEL_ZERO, _ACCEL_MOST = 83.0, 2047, 4095
_GYRO_PER_DEG_S, _MAG_PER_GAUSS, _WIDE_ACCEL_PER_M_S2 = 65.5, 1100.0, 1671.0
_ALIGNED = (100, 0, 0, 0, 100, 0, 0, 0, 100)
_MOST_16 = 32767
_PARAMETERS = {0x05: 2, 0x08: 3}
"""Commands that are followed by so many bytes: set the rate, set the sensors."""


def data_packet(clock_s: float, accel_m_s2: Numbers, gyro_rad_s: Numbers, mag_ut: Numbers) -> bytes:
    """Stamp and channels; the gyroscope is big-endian, all else little-endian."""
    ticks = round(TICKS_HZ * clock_s) % 2**24
    accel = (min(max(round(_ACCEL_PER_M_S2 * a) + _ACCEL_ZERO, 0), _ACCEL_MOST) for a in accel_m_s2)
    gyro = (_counts(_GYRO_PER_DEG_S * math.degrees(rate)) for rate in gyro_rad_s)
    mag = (_counts(_MAG_PER_GAUSS * field / 100.0) for field in mag_ut)
    stamp = bytes([0, ticks & 255, ticks >> 8 & 255, ticks >> 16])
    return stamp + pack("<3h", *accel) + pack(">3h", *gyro) + pack("<3h", *mag)


def inquiry_response(rate_hz: float) -> bytes:
    """Sampling interval in ticks, configuration, number of channels, one packet at once, the channels."""
    return b"\x02" + pack("<HIBB", round(TICKS_HZ / rate_hz), 0x0901FF01, len(_CHANNELS), 1) + _CHANNELS


def calibration_response() -> bytes:
    """Of low-noise accelerometer, gyroscope, magnetometer and wide-range accelerometer: zero, sensitivity, axes."""
    sensors = (
        (_ACCEL_ZERO, round(_ACCEL_PER_M_S2)),
        (0, round(100 * _GYRO_PER_DEG_S)),
        (0, round(_MAG_PER_GAUSS)),
        (0, round(_WIDE_ACCEL_PER_M_S2)),
    )
    return b"\x2d" + b"".join(pack(">6h9b", *[zero] * 3, *[gain] * 3, *_ALIGNED) for zero, gain in sensors)


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """What a unit sends that was asked and started at once."""
    units = Units(emulated)
    for name in emulated.recording.names:
        yield DeviceMessage(0.0, name, units.answer(name, b"\x01\x2c\x07"))
    yield from units.streaming()


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a unit with a serial line; the magnetometer's unit is not uT."""
    names = emulated.recording.names
    streams = {name: (name, "") for name in names}
    own = senders(emulated.place, "shimmer3", names)
    return Wiring("shimmer3", own, streams, {}, ("gyro_rad_s", "accel_m_s2"))


async def emulate(emulated: Emulated) -> None:
    """Answer commands, and stream what is due from `start` to `stop`, until the movement ends, or it is cancelled."""
    units = Units(emulated)
    await carry(emulated, emulated.recording.names, units.streaming(), units.answer)


class Units:
    """Which units stream.

    Args:
        emulated: what they measure.
    """

    def __init__(self, emulated: Emulated) -> None:
        self._emulated = emulated
        self._rates = {stream.name: stream.rate_hz for stream in emulated.recording.streams}
        self._started: set[str] = set()

    def answer(self, unit: str, commands: bytes) -> bytes:
        """The replies to commands; each is acknowledged."""
        replies, at = b"", 0
        while at < len(commands):
            replies += _ACK + self._reply(unit, commands[at])
            at += 1 + _PARAMETERS.get(commands[at], 0)
        return replies

    def streaming(self) -> Iterator[DeviceMessage]:
        """Data packets of the units that have been started."""
        for delivery in self._emulated.deliveries():
            # An empty message lets the time go on.
            data = _packet(delivery) if delivery.device in self._started else b""
            yield DeviceMessage(delivery.due_s, delivery.device, data)

    def _reply(self, unit: str, command: int) -> bytes:
        rate_hz = self._rates[unit]
        if command == 0x07:
            self._started.add(unit)
        elif command == 0x20:
            self._started.discard(unit)
        elif command == 0x01:
            return inquiry_response(rate_hz)
        elif command == 0x03:
            return b"\x04" + pack("<H", round(TICKS_HZ / rate_hz))
        elif command == 0x2C:
            return calibration_response()
        return b""


def _packet(delivery: Delivery) -> bytes:
    values = cast("dict[str, tuple[float, ...]]", delivery.values)
    nothing = (0.0, 0.0, 0.0)
    measured = (values.get(name, nothing) for name in ("accel_m_s2", "gyro_rad_s", "mag_ut"))
    return data_packet(delivery.clock_s, *measured)


def _counts(value: float) -> int:
    return min(max(round(value), -_MOST_16 - 1), _MOST_16)
