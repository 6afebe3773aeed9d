"""Where virtual Bluetooth devices meet: on a link in this process, or at an adapter of this machine."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from bumble.controller import Controller
from bumble.device import Device
from bumble.hci import Address
from bumble.host import Host
from bumble.link import LocalLink
from bumble.transport import open_transport
from bumble.transport.common import AsyncPipeSink


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
