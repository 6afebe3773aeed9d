"""Where an emulated Bluetooth device sends, and how a receiver finds it; the devices themselves are `Peripheral`s."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from oarlock.live.emulators.air import on_adapter
from oarlock.live.emulators.carriers import paced
from oarlock.live.emulators.emulated import DeviceMessage, Emulated, UnitAddress
from oarlock.live.emulators.peripheral import Peripheral
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from bumble.device import Device

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
