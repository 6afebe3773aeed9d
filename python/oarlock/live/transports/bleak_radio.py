"""This machine's Bluetooth adapter, by bleak (`oarlock[ble]`), for the transport."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from oarlock.live.transports.radio import BleAdvertisement, RadioError
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from bleak import BleakClient, BleakScanner
    from bleak.backends.device import BLEDevice

T = TypeVar("T")


class BleakRadio:
    """The adapter that the system uses.

    Raises:
        DataError: bleak is not installed.
    """

    def __init__(self) -> None:
        try:
            bleak: Any = import_module("bleak")
        except ImportError as error:
            raise DataError("Bluetooth needs the package bleak: pip install 'oarlock[ble]'") from error
        self._client: type[BleakClient] = bleak.BleakClient
        self._scanner: type[BleakScanner] = bleak.BleakScanner
        self._error: type[Exception] = bleak.exc.BleakError
        self._clients: dict[str, BleakClient] = {}
        self._seen: dict[str, BLEDevice] = {}

    async def scan(self, duration_s: float) -> list[BleAdvertisement]:
        """The devices that advertise within a time, the nearest first."""
        heard = await self._done(self._scanner.discover(timeout=duration_s, return_adv=True))
        self._seen |= {device.address: device for device, _ in heard.values()}
        found = [
            BleAdvertisement(
                device.address, told.local_name or device.name or "", tuple(told.service_uuids), told.rssi
            )
            for device, told in heard.values()
        ]
        return sorted(found, key=lambda one: -one.rssi_dbm)

    async def connect(self, address: str, lost: Callable[[], None]) -> None:
        """Connect a device; one that no scan has found is searched for first."""
        client = self._client(self._seen.get(address, address), disconnected_callback=lambda _: lost())
        self._clients[address] = client
        await self._done(client.connect())

    async def subscribe(self, address: str, characteristic: str, receive: Callable[[bytes], None]) -> None:
        """Have a characteristic notify."""
        client = self._connected(address)
        await self._done(client.start_notify(characteristic, lambda _, data: receive(bytes(data))))

    async def write(self, address: str, characteristic: str, data: bytes) -> None:
        """Write a characteristic and wait for the device's answer."""
        await self._done(self._connected(address).write_gatt_char(characteristic, data, response=True))

    async def disconnect(self, address: str) -> None:
        """End a connection; nothing happens if there is none."""
        if client := self._clients.pop(address, None):
            await self._done(client.disconnect())

    def _connected(self, address: str) -> BleakClient:
        if address not in self._clients:
            raise RadioError(f"{address} is not connected")
        return self._clients[address]

    async def _done(self, asked: Awaitable[T]) -> T:
        """What bleak answers, with its errors as `RadioError`."""
        try:
            return await asked
        except TimeoutError as error:
            raise RadioError("no answer") from error
        except self._error as error:
            raise RadioError(str(error) or type(error).__name__) from error
        except (EOFError, OSError) as error:
            raise RadioError(
                f"this machine's Bluetooth service does not answer ({error}); Linux: systemctl start bluetooth"
            ) from error
