"""Bluetooth Low Energy: connects devices, asks them for their data, connects them again when they are lost."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from weakref import WeakKeyDictionary

from oarlock.live.reading import Packet
from oarlock.live.transports.ble_profiles import KINDS, Profile, Subscribe, Write
from oarlock.live.transports.radio import Radio, RadioError, short
from oarlock.live.transports.transport import Deliver, Options, ToldState, again_and_again, now_ns
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

# A connection that is not there by then will not come, and others wait for their turn.
CONNECT_S = 20.0
_STOP_S = 2.0

# Adapters fail if they are to connect several devices at once.
_TURNS: WeakKeyDictionary[asyncio.AbstractEventLoop, asyncio.Lock] = WeakKeyDictionary()


class Ble:
    """Devices of one kind. A packet's channel is the short UUID of the characteristic, such as `2A37` or `CE060035`.

    Options: `addresses`, a list, or `address`; `rate_hz` of a DOT, `period_ms` of a PM5. Two follow from a rig file's
    format and decoder: `profile`, a name of `ble_profiles.KINDS`, and the `mode` of a DOT.

    Args:
        source: its name.
        options: of the rig file.
        radio: the adapter; by default that of this machine, by bleak.
    """

    def __init__(self, source: str, options: Options, radio: Radio | None = None) -> None:
        name = options.text("profile")
        if name not in KINDS:
            raise DataError(f"source '{source}': the option profile: {did_you_mean(name, sorted(KINDS))}")
        options.check("profile", "address", "addresses", *KINDS[name].options)
        addresses = (
            options.texts("addresses") if "addresses" in options.values else (options.text("address"),)
        )
        profile, radio = KINDS[name].profile(options), radio or own_radio()
        self.state = "not started"
        self.links = tuple(
            BleConnection(source, address, profile, radio, self._told) for address in addresses
        )
        """One for each device."""

    async def run(self, deliver: Deliver) -> None:
        """Delivers each notification as a packet until it is cancelled; then stops and disconnects the devices."""
        async with asyncio.TaskGroup() as group:
            for link in self.links:
                group.create_task(link.run(deliver))

    def _told(self) -> None:
        self.state = "; ".join(link.state for link in self.links)


class BleConnection(ToldState):
    """A device that is kept connected.

    Args:
        source, address: of its packets.
        profile: what to ask of it.
        radio: the adapter.
        told: called when `state` has changed.
    """

    def __init__(
        self, source: str, address: str, profile: Profile, radio: Radio, told: Callable[[], None]
    ) -> None:
        super().__init__(f"waits for its turn to connect to {address}", told)
        self.source, self.address = source, address
        self._profile, self._radio = profile, radio

    async def run(self, deliver: Deliver) -> None:
        """Delivers notifications until it is cancelled."""
        await again_and_again(self, lambda: self._connected(deliver), self.address)

    async def _connected(self, deliver: Deliver) -> None:
        lost = asyncio.Event()
        try:
            async with _turn(), asyncio.timeout(CONNECT_S):
                await self._radio.connect(self.address, lost.set)
                for step in self._profile.start:
                    await self._take(step, deliver)
            self.state = f"receives from {self.address}"
            await lost.wait()
        finally:
            await self._end(lost)

    async def _take(self, step: Subscribe | Write, deliver: Deliver) -> None:
        if isinstance(step, Write):
            return await self._radio.write(self.address, step.characteristic, step.data)
        channel = short(step.characteristic)

        def receive(data: bytes) -> None:
            deliver(Packet(self.source, self.address, channel, now_ns(), data))

        try:
            await self._radio.subscribe(self.address, step.characteristic, receive)
        except RadioError:
            if step.needed:
                raise

    async def _end(self, lost: asyncio.Event) -> None:
        with suppress(OSError):
            async with asyncio.timeout(_STOP_S):
                for step in () if lost.is_set() else self._profile.stop:
                    await self._radio.write(self.address, step.characteristic, step.data)
        with suppress(OSError):
            async with asyncio.timeout(_STOP_S):
                await self._radio.disconnect(self.address)


def _turn() -> asyncio.Lock:
    return _TURNS.setdefault(asyncio.get_running_loop(), asyncio.Lock())


def own_radio() -> Radio:
    """This machine's Bluetooth adapter."""
    from oarlock.live.transports.bleak_radio import BleakRadio

    return BleakRadio()
