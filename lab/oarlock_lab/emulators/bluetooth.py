"""Virtual Bluetooth devices by bumble: peripherals, where they send, and the radio that receives them in tests."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar
from uuid import UUID as StandardUuid

from bumble.att import Attribute
from bumble.controller import Controller
from bumble.core import UUID, AdvertisingData, BaseBumbleError
from bumble.device import Advertisement, Connection, Device, Peer
from bumble.gatt import Characteristic, CharacteristicValue, Service
from bumble.gatt_client import CharacteristicProxy
from bumble.hci import Address
from bumble.host import Host
from bumble.link import LocalLink
from bumble.transport import open_transport
from bumble.transport.common import AsyncPipeSink

from oarlock.live.transports.radio import BleAdvertisement, RadioError
from oarlock.storage.errors import DataError
from oarlock_lab.emulators.carriers import paced
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, UnitAddress


class Air:
    """A link within this process; devices on it hear each other, nobody else does."""

    def __init__(self) -> None:
        self._link = LocalLink()  # type: ignore[no-untyped-call]
        self._places = 0
        self._controllers: dict[str, Controller] = {}

    def device(self, address: str = "") -> Device:
        """A new device, in place of one with its address; without one it gets the next of F0:00:00:00:00:01 and on."""
        self._places += 1
        address = address or f"F0:00:00:00:00:{self._places:02X}"
        if before := self._controllers.pop(address, None):
            self._link.remove_controller(before)
        controller = self._controllers[address] = Controller(address, link=self._link)
        return Device(address=Address(address), host=Host(controller, AsyncPipeSink(controller)))


@asynccontextmanager
async def on_adapter(transport: str, address: str = "F0:00:00:00:00:01") -> AsyncIterator[Device]:
    """A device that sends by a Bluetooth adapter which the system does not use.

    Args:
        transport: the adapter as bumble names it, such as `usb:0` or `serial:/dev/ttyUSB0`.
        address: random address to send from.
    """
    async with await open_transport(transport) as adapter:
        yield Device.with_hci("", Address(address), adapter.source, adapter.sink)


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


ADDRESS = "F0:00:00:00:00:01"


def sender(name: str) -> UnitAddress:
    """The one device of a source."""
    return UnitAddress(name, "ble", {"address": ADDRESS}, ADDRESS)


@asynccontextmanager
async def placed(emulated: Emulated, address: str = ADDRESS) -> AsyncIterator[Device]:
    """The device at the adapter of the place.

    Raises:
        DataError: no adapter is given, or it cannot be opened.
    """
    adapter = emulated.place.adapter
    if not adapter:
        raise DataError(
            "an emulated Bluetooth device needs an adapter that the system does not use: --adapter usb:0, or what "
            "bumble calls it (https://google.github.io/bumble/transports)"
        )
    try:
        async with on_adapter(adapter, address) as device:
            emulated.say(f"advertises at {adapter} as {address}")
            yield device
    except OSError as error:
        raise DataError(f"the Bluetooth adapter {adapter} cannot be used ({error})") from error


async def notify(
    peripheral: Peripheral,
    messages: Iterable[DeviceMessage],
    uuid: Callable[[str], str] = lambda channel: channel,
    sent: Callable[[DeviceMessage], None] = lambda message: None,
) -> None:
    """Notifies each message when it is due.

    Args:
        peripheral: that is there.
        messages: in the order of arrival.
        uuid: of a message's channel.
        sent: called with each message that was notified.
    """
    async for message in paced(messages):
        if await peripheral.notify(uuid(message.channel), message.data):
            sent(message)


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
    full = tuple(str(StandardUuid(bytes=one.to_bytes(force_128=True)[::-1])) for one in services)
    return BleAdvertisement(str(told.address).partition("/")[0], str(name), full, float(told.rssi))
