"""Virtual Movella DOTs that send what an inertial unit measures, in a raw mode.

Source: Movella, "DOT BLE Services Specifications", XD0506P revision C. Numbers are little-endian, the stamp
is in us in 32 bits. Characteristics have a fixed length; zeros follow a shorter payload. The magnetometer
counts 1/4096 of an arbitrary unit, here of 50 uT.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from itertools import chain, islice
from struct import pack
from typing import cast

import numpy as np
from bumble.device import Device

from oarlock.live.simulated_devices import Delivery
from oarlock.live.transports.radio import short
from oarlock.recording.streams import ImuStream
from oarlock.storage.errors import DataError
from oarlock_lab.emulators.bluetooth import Offers, Peripheral, placed
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, UnitAddress, Wiring


class Together:
    """Units wait for each other, and have one start.

    Args:
        count: of the units.
    """

    def __init__(self, count: int) -> None:
        self._all = asyncio.Barrier(count)
        self._began_s: float | None = None

    async def begun(self) -> float:
        """Waits until all units wait; the start, s by the clock of the event loop, is the same for all."""
        await self._all.wait()
        # A busy machine may pause between two units.
        if self._began_s is None:
            self._began_s = asyncio.get_running_loop().time()
        return self._began_s


_UUID = "1517{:04x}-4947-11e9-8646-d663bd873d93"
_CONTROL, _MEASURE, _BATTERY = 0x1002, 0x2001, 0x3001
_LONG, _MEDIUM = (0x2002, 63), (0x2003, 40)
_PAYLOADS = {20: _MEDIUM, 21: _MEDIUM, 26: _LONG}
_MAG_PER_UT = 4096.0 / 50.0

MODE, RATE_HZ = 20, 60
NAME = "Movella DOT"
_UNTURNED = (1.0, 0.0, 0.0, 0.0)

Numbers = Sequence[float]
Row = tuple[float, int, bytes]


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


def messages(emulated: Emulated, mode: int = MODE) -> Iterator[DeviceMessage]:
    """The notifications of all units."""
    channel = short(_UUID.format(_PAYLOADS[mode][0]))
    for delivery in emulated.deliveries():
        data = _payload_of(delivery, mode)
        if data is not None:
            yield DeviceMessage(delivery.due_s, delivery.device, data, channel)


def wiring(emulated: Emulated) -> Wiring:
    """Units of one source, by their addresses; the magnetometer's unit is not uT."""
    names = emulated.recording.names
    addresses = [f"D4:22:CD:00:00:{number:02X}" for number in range(1, len(names) + 1)]
    options: dict[str, object] = {"addresses": addresses, "rate_hz": RATE_HZ}
    senders = {n: UnitAddress("dot", "ble", options, a) for n, a in zip(names, addresses, strict=True)}
    streams = {name: (name, "") for name in names}
    return Wiring("dot", senders, streams, {"mode": MODE}, ("gyro_rad_s", "accel_m_s2"))


async def emulate(emulated: Emulated) -> None:
    """Be one unit at the place's adapter until it is cancelled; the movement begins with each start command.

    Raises:
        DataError: there are several units: an adapter has one address.
    """
    if len(emulated.recording.names) != 1:
        known = ",".join(emulated.recording.names)
        raise DataError(f"an adapter can be one unit; choose it with --units: {known}")
    [(unit, own)] = wiring(emulated).senders.items()
    async with placed(emulated, own.address) as device:
        await be(device, emulated, unit)


async def be(
    device: Device,
    emulated: Emulated,
    unit: str,
    *,
    name: str = NAME,
    begun: Callable[[], Awaitable[float]] | None = None,
    sent: Callable[[int], None] = lambda row: None,
) -> None:
    """Be one unit of a recording until cancelled.

    Args:
        device: of `air`, on a link of this process or on an adapter.
        emulated: what all units measure, and what goes wrong on the way.
        unit: name of the stream.
        name: that it advertises.
        begun: awaited after each start command; gives when the movement begins, by the clock of the event loop. Without
            it that is now. Several units take that of one `Together`.
        sent: called with the count of each reading that was notified.
    """

    def rows(mode: int) -> Iterator[Row]:
        for delivery in emulated.deliveries():
            data = _payload_of(delivery, mode) if delivery.device == unit else None
            if data is not None:
                yield delivery.due_s, delivery.count, data

    await _DotSender(device, name, rows, begun).run(sent)


async def run(
    device: Device,
    stream: ImuStream,
    *,
    quat_wxyz: np.ndarray | None = None,
    name: str = NAME,
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
    count, nothing = len(stream.time_s), np.zeros((len(stream.time_s), 3))
    columns = [nothing if a is None else a for a in (stream.gyro_rad_s, stream.accel_m_s2, stream.mag_ut)]
    columns.append(np.tile(_UNTURNED, (count, 1)) if quat_wxyz is None else quat_wxyz)

    def rows(mode: int) -> Iterator[Row]:
        for row, time_s in enumerate((stream.time_s - stream.time_s[0]).tolist()):
            gyro, accel, mag, quat = (values[row].tolist() for values in columns)
            if all(map(math.isfinite, (*gyro, *accel, *mag, *quat))):
                stamp_us = first_us + round(1e6 * time_s)
                yield time_s / speed, row, payload(mode, stamp_us, gyro, accel, mag, quat)

    await _DotSender(device, name, rows).run(sent)


def _payload_of(delivery: Delivery, mode: int) -> bytes | None:
    """The measurement; None without gyroscope or accelerometer."""
    values = cast("Mapping[str, Numbers]", delivery.values)
    if "gyro_rad_s" not in values or "accel_m_s2" not in values:
        return None
    stamp_us = round(1e6 * delivery.clock_s)
    field = values.get("mag_ut", (0.0, 0.0, 0.0))
    return payload(mode, stamp_us, values["gyro_rad_s"], values["accel_m_s2"], field, _UNTURNED)


class _DotSender:
    """Sends the rows of a mode: when each is due after the start, its number, and the payload."""

    def __init__(
        self,
        device: Device,
        name: str,
        rows: Callable[[int], Iterator[Row]],
        begun: Callable[[], Awaitable[float]] | None = None,
    ) -> None:
        services = {
            _UUID.format(0x1000): Offers(written=[_UUID.format(_CONTROL)]),
            _UUID.format(0x2000): Offers(
                [_UUID.format(number) for number in (0x2002, 0x2003, 0x2004)], [_UUID.format(_MEASURE)]
            ),
            _UUID.format(0x3000): Offers([_UUID.format(_BATTERY)]),
        }
        self._peripheral = Peripheral(device, name, services, self._written)
        self._rows, self._begun = rows, begun
        self._mode: int | None = None
        self._told = asyncio.Event()

    async def run(self, sent: Callable[[int], None]) -> None:
        async with self._peripheral.there():
            while True:
                await self._told.wait()
                self._told.clear()
                if self._mode is not None:
                    await self._peripheral.notify(_UUID.format(_BATTERY), bytes([88, 0]))
                    await self._send(self._mode, sent)

    async def _send(self, mode: int, sent: Callable[[int], None]) -> None:
        rows = self._rows(mode)
        # To make the first row may take a while, by which units that begin together would be apart.
        first = list(islice(rows, 1))
        loop, uuid = asyncio.get_running_loop(), _UUID.format(_PAYLOADS[mode][0])
        began_s = loop.time() if self._begun is None else await self._begun()
        for due_s, row, data in chain(first, rows):
            await asyncio.sleep(began_s + due_s - loop.time())
            if self._told.is_set():  # stopped, or started anew
                return
            if await self._peripheral.notify(uuid, data):
                sent(row)

    def _written(self, uuid: str, data: bytes) -> None:
        """Take a start (1 1 mode) or stop (1 0 mode) command; settings need no answer."""
        if uuid != _UUID.format(_MEASURE) or len(data) < 3 or data[0] != 1:
            return
        self._mode = data[2] if data[1] and data[2] in _PAYLOADS else None
        self._told.set()
