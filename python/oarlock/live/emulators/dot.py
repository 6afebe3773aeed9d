"""A virtual Movella DOT that replays a stream of an inertial unit in a raw mode.

Source: Movella, "DOT BLE Services Specifications", XD0506P revision C. Numbers are little-endian, the stamp
is in us in 32 bits. Characteristics have a fixed length; zeros follow a shorter payload. The magnetometer
counts 1/4096 of an arbitrary unit, here of 50 uT.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Sequence
from struct import pack

import numpy as np
from bumble.device import Device

from oarlock.live.emulators.peripheral import Offers, Peripheral
from oarlock.recording.streams import ImuStream

_UUID = "1517{:04x}-4947-11e9-8646-d663bd873d93"
_CONTROL, _MEASURE, _BATTERY = 0x1002, 0x2001, 0x3001
_LONG, _MEDIUM = (0x2002, 63), (0x2003, 40)
_PAYLOADS = {20: _MEDIUM, 21: _MEDIUM, 26: _LONG}
_MAG_PER_UT = 4096.0 / 50.0

Numbers = Sequence[float]


def payload(
    mode: int, stamp_us: int, gyro_rad_s: Numbers, accel_m_s2: Numbers, mag_ut: Numbers, quat_wxyz: Numbers
) -> bytes:
    """A measurement in mode 20 (acceleration, rate, magnetometer), 21 (without it) or 26 (quaternion first)."""
    rates = [math.degrees(rate) for rate in gyro_rad_s]
    data = pack("<I", stamp_us % (1 << 32)) + (pack("<4f", *quat_wxyz) if mode == 26 else b"")
    data += pack("<6f", *accel_m_s2, *rates)
    if mode == 20:
        data += pack("<3h", *(max(-32768, min(32767, round(_MAG_PER_UT * field))) for field in mag_ut))
    return data.ljust(_PAYLOADS[mode][1], b"\x00")


async def run(
    device: Device,
    stream: ImuStream,
    *,
    quat_wxyz: np.ndarray | None = None,
    name: str = "Movella DOT",
    first_us: int = 0,
    speed: float = 1.0,
    sent: Callable[[int], None] = lambda row: None,
) -> None:
    """Be a DOT until cancelled. It begins to replay, from the first row, with each start command.

    Args:
        device: of `air`, on a link of this process or on an adapter.
        stream: with gyroscope and accelerometer; rows without numbers are left out, as if lost. A DOT sends at most
            60 Hz; the stream's own rate is kept.
        quat_wxyz: (T, 4) orientations for mode 26, world from sensor; without them all are 1, 0, 0, 0.
        name: that it advertises.
        first_us: the stamp of the first row.
        speed: 2.0 replays twice as fast, with the same stamps.
        sent: called with the index of each row that was notified.
    """
    await _Unit(device, stream, quat_wxyz, name).run(first_us, speed, sent)


class _Unit:
    def __init__(self, device: Device, stream: ImuStream, quat_wxyz: np.ndarray | None, name: str) -> None:
        services = {
            _UUID.format(0x1000): Offers(written=[_UUID.format(_CONTROL)]),
            _UUID.format(0x2000): Offers(
                [_UUID.format(number) for number in (0x2002, 0x2003, 0x2004)], [_UUID.format(_MEASURE)]
            ),
            _UUID.format(0x3000): Offers([_UUID.format(_BATTERY)]),
        }
        self._peripheral = Peripheral(device, name, services, self._written)
        count, nothing = len(stream.time_s), np.zeros((len(stream.time_s), 3))
        self._time_s = stream.time_s
        self._rows = [
            nothing if a is None else a for a in (stream.gyro_rad_s, stream.accel_m_s2, stream.mag_ut)
        ]
        self._rows.append(np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)) if quat_wxyz is None else quat_wxyz)
        self._mode: int | None = None
        self._told = asyncio.Event()

    async def run(self, first_us: int, speed: float, sent: Callable[[int], None]) -> None:
        async with self._peripheral.there():
            while True:
                await self._told.wait()
                self._told.clear()
                if self._mode is not None:
                    await self._peripheral.notify(_UUID.format(_BATTERY), bytes([88, 0]))
                    await self._replay(self._mode, first_us, speed, sent)

    async def _replay(self, mode: int, first_us: int, speed: float, sent: Callable[[int], None]) -> None:
        loop = asyncio.get_running_loop()
        began_s, uuid = loop.time(), _UUID.format(_PAYLOADS[mode][0])
        for row, time_s in enumerate(self._time_s - self._time_s[0]):
            await asyncio.sleep(began_s + time_s / speed - loop.time())
            if self._told.is_set():  # stopped, or started anew
                return
            gyro, accel, mag, quat = (values[row].tolist() for values in self._rows)
            if not all(map(math.isfinite, (*gyro, *accel, *mag, *quat))):
                continue
            data = payload(mode, first_us + round(1e6 * time_s), gyro, accel, mag, quat)
            if await self._peripheral.notify(uuid, data):
                sent(row)

    def _written(self, uuid: str, data: bytes) -> None:
        """Take a start (1 1 mode) or stop (1 0 mode) command; settings need no answer."""
        if uuid != _UUID.format(_MEASURE) or len(data) < 3 or data[0] != 1:
            return
        self._mode = data[2] if data[1] and data[2] in _PAYLOADS else None
        self._told.set()
