"""The Bluetooth transport's radio by bumble: it connects virtual devices, in tests and demonstrations."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import TypeVar

from bumble.core import UUID, AdvertisingData, BaseBumbleError
from bumble.device import Advertisement, Connection, Device, Peer
from bumble.gatt_client import CharacteristicProxy

from oarlock.live.transports.radio import BleAdvertisement, RadioError

T = TypeVar("T")
_MTU = 247


class VirtualRadio:
    """The five methods on a device of `air`."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._is_on = False
        self._connections: dict[str, Connection] = {}
        self._peers: dict[str, Peer] = {}

    async def scan(self, duration_s: float) -> list[BleAdvertisement]:
        """The devices that advertise within a time."""
        await self._power_on()
        heard: dict[str, BleAdvertisement] = {}

        def hear(told: Advertisement) -> None:
            found = _found(told)
            before = heard.get(found.address, found)
            services = tuple(dict.fromkeys((*before.services, *found.services)))
            heard[found.address] = replace(found, name=found.name or before.name, services=services)

        self._device.on(Device.EVENT_ADVERTISEMENT, hear)
        await self._done(self._device.start_scanning())
        await asyncio.sleep(duration_s)
        await self._done(self._device.stop_scanning())
        self._device.remove_listener(Device.EVENT_ADVERTISEMENT, hear)
        return list(heard.values())

    async def connect(self, address: str, lost: Callable[[], None]) -> None:
        """Connect a device, with an MTU for long notifications, and find its characteristics."""
        await self._power_on()
        connection = await self._done(self._device.connect_le(address, timeout=5.0))
        self._connections[address] = connection

        def ended(_: int) -> None:
            self._connections.pop(address, None)
            lost()

        connection.on(Connection.EVENT_DISCONNECTION, ended)
        peer = self._peers[address] = Peer(connection)
        await self._done(peer.request_mtu(_MTU))
        await self._done(peer.discover_services())
        for service in peer.services:
            await self._done(peer.discover_characteristics(service=service))

    async def subscribe(self, address: str, characteristic: str, receive: Callable[[bytes], None]) -> None:
        """Have a characteristic notify."""
        await self._done(self._peer(address).subscribe(self._of(address, characteristic), receive))

    async def write(self, address: str, characteristic: str, data: bytes) -> None:
        """Write a characteristic and wait for the device's answer."""
        one = self._of(address, characteristic)
        await self._done(self._peer(address).write_value(one, data, with_response=True))

    async def disconnect(self, address: str) -> None:
        """End a connection; nothing happens if there is none."""
        self._peers.pop(address, None)
        if connection := self._connections.pop(address, None):
            await self._done(connection.disconnect())

    async def _power_on(self) -> None:
        if not self._is_on:
            self._is_on = True
            await self._done(self._device.power_on())

    def _peer(self, address: str) -> Peer:
        if address not in self._peers:
            raise RadioError(f"{address} is not connected")
        return self._peers[address]

    def _of(self, address: str, characteristic: str) -> CharacteristicProxy[bytes]:
        found = self._peer(address).get_characteristics_by_uuid(UUID(characteristic))
        if not found:
            raise RadioError(f"{address} has no characteristic {characteristic}")
        return found[0]

    async def _done(self, asked: Awaitable[T]) -> T:
        try:
            return await asked
        except BaseBumbleError as error:
            raise RadioError(str(error) or type(error).__name__) from error


def _found(told: Advertisement) -> BleAdvertisement:
    kind = AdvertisingData.Type
    short = told.data.get_all(kind.COMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS)
    long = told.data.get_all(kind.COMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS)
    services = [one for several in (*short, *long) for one in several]
    name = told.data.get(kind.COMPLETE_LOCAL_NAME) or ""
    full = tuple(str(uuid.UUID(bytes=one.to_bytes(force_128=True)[::-1])) for one in services)
    return BleAdvertisement(str(told.address).partition("/")[0], str(name), full, float(told.rssi))
