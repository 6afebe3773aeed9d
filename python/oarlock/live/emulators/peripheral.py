"""A Bluetooth peripheral with characteristics that notify and that can be written, for the emulators."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial

from bumble.att import Attribute
from bumble.core import UUID, AdvertisingData, BaseBumbleError
from bumble.device import Connection, Device
from bumble.gatt import Characteristic, CharacteristicValue, Service

Properties = Characteristic.Properties
Permissions = Attribute.Permissions
_Told = tuple[int, bytes]


@dataclass(frozen=True)
class Offers:
    """What a service has: UUIDs of the characteristics that notify, and of those that can be written."""

    notifies: Sequence[str] = ()
    written: Sequence[str] = ()


class Peripheral:
    """A device that advertises a name and services, and notifies who has subscribed.

    Args:
        device: on a link or an adapter (`air`).
        name: that it advertises.
        services: UUID -> what the service has; the first is advertised.
        written: called with the UUID and the data when a characteristic is written.
    """

    def __init__(
        self,
        device: Device,
        name: str,
        services: Mapping[str, Offers],
        written: Callable[[str, bytes], None] = lambda uuid, data: None,
    ) -> None:
        self._device, self._name, self._services, self._written = device, name, services, written
        self._notifying: dict[str, Characteristic[bytes]] = {}
        self._subscribed: set[str] = set()

    @asynccontextmanager
    async def there(self) -> AsyncIterator[None]:
        """Advertise, again after each connection; at the end disconnect, as a device that is switched off."""
        await self._begin()
        try:
            yield
        finally:
            await self._end()

    async def _begin(self) -> None:
        for uuid, offers in self._services.items():
            self._device.add_service(Service(UUID(uuid), self._characteristics(offers)))
        self._device.on(Device.EVENT_CONNECTION, self._connected)
        await self._device.power_on()
        told, answered = self._advertised()
        await self._device.start_advertising(
            auto_restart=True,
            advertising_data=bytes(AdvertisingData(told)),
            scan_response_data=bytes(AdvertisingData(answered)),
        )

    def _advertised(self) -> tuple[list[_Told], list[_Told]]:
        """What is advertised, and what is answered to a scan: 31 bytes have no room for a name and a long UUID."""
        first, kind = bytes(UUID(next(iter(self._services)))), AdvertisingData.Type
        told: list[_Told] = [(kind.FLAGS, bytes([6])), (kind.COMPLETE_LOCAL_NAME, self._name.encode())]
        if len(first) > 2:
            return told, [(kind.COMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS, first)]
        return [*told, (kind.COMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS, first)], []

    async def _end(self) -> None:
        await self._device.stop_advertising()
        for connection in list(self._device.connections.values()):
            with suppress(BaseBumbleError):
                await connection.disconnect()

    def is_subscribed(self, uuid: str) -> bool:
        """Whether a characteristic notifies anybody."""
        return uuid in self._subscribed

    async def notify(self, uuid: str, data: bytes) -> bool:
        """Send a value to who has subscribed; False if nobody has."""
        if uuid not in self._subscribed:
            return False
        await self._device.notify_subscribers(self._notifying[uuid], data)
        return True

    def _characteristics(self, offers: Offers) -> list[Characteristic[bytes]]:
        for uuid in offers.notifies:
            one: Characteristic[bytes] = Characteristic(uuid, Properties.NOTIFY, Permissions.READABLE, b"")
            one.on(Characteristic.EVENT_SUBSCRIPTION, partial(self._subscription, uuid))
            self._notifying[uuid] = one
        return [self._notifying[uuid] for uuid in offers.notifies] + [
            self._writable(uuid) for uuid in offers.written
        ]

    def _writable(self, uuid: str) -> Characteristic[bytes]:
        taken: CharacteristicValue[bytes] = CharacteristicValue(
            write=lambda _, data: self._written(uuid, data)
        )
        return Characteristic(uuid, Properties.WRITE, Permissions.WRITEABLE, taken)

    def _subscription(self, uuid: str, connection: Connection, notifies: bool, indicates: bool) -> None:
        (self._subscribed.add if notifies else self._subscribed.discard)(uuid)

    def _connected(self, connection: Connection) -> None:
        connection.on(Connection.EVENT_DISCONNECTION, lambda _: self._subscribed.clear())
