"""Connections to devices that serve their data at a port, as an x-IMU3 or MVN does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack

from oarlock.live.reading import Packet
from oarlock.live.transports.announced import Announcements
from oarlock.live.transports.transport import Deliver, Options, ToldState, again_and_again, now_ns
from oarlock.storage.errors import DataError

READ_BYTES = 512
"""Some readings. Of what waits for a busy program each device has its share in turn, else the readings of one would
make those of all others too late."""
Where = Callable[[], Awaitable[tuple[str, int]]]


class Tcp:
    """Connects to devices, and again when they are lost.

    Options: `host` and `port` of a device; or `units`, serial numbers or names of x-IMU3 units, whose addresses are
    found from what they announce. The address of a device is `host:port`, or the unit as the rig file names it.
    """

    def __init__(self, source: str, options: Options) -> None:
        self.source, self.state = source, "not started"
        self._units: tuple[str, ...] = ()
        if "units" in options.values:
            options.check("units")
            self._units = options.texts("units")
            return
        options.check("host", "port")
        self.host, self.port = options.text("host"), options.port()

    async def run(self, deliver: Deliver) -> None:
        """Delivers what arrives together as a packet until it is cancelled."""
        async with AsyncExitStack() as stack:
            links = await self._links(stack)

            def told() -> None:
                self.state = "; ".join(link.state for link in links)

            async with asyncio.TaskGroup() as group:
                for link in links:
                    link.told = told
                    group.create_task(link.run(deliver))

    async def _links(self, stack: AsyncExitStack) -> list[_TcpDevice]:
        if not self._units:
            place = f"{self.host}:{self.port}"
            return [_TcpDevice(self.source, place, place, self._given)]
        try:
            announced = await stack.enter_async_context(Announcements())
        except OSError as error:
            raise DataError(
                f"source '{self.source}': cannot hear which x-IMU3 units there are ({error.strerror}). "
                "Give host and port of each in place of units"
            ) from error
        return [
            _TcpDevice(self.source, unit, f"x-IMU3 {unit}", _found(announced, unit)) for unit in self._units
        ]

    async def _given(self) -> tuple[str, int]:
        return self.host, self.port


def _found(announced: Announcements, unit: str) -> Where:
    async def where() -> tuple[str, int]:
        told = await announced.unit(unit)
        return told.address, told.tcp_port

    return where


class _TcpDevice(ToldState):
    """One device."""

    def __init__(self, source: str, address: str, place: str, where: Where) -> None:
        super().__init__("not started")
        self._source, self._address, self._place, self._where = source, address, place, where

    async def run(self, deliver: Deliver) -> None:
        await again_and_again(self, lambda: self._connected(deliver), self._place)

    async def _connected(self, deliver: Deliver) -> None:
        reader, writer = await asyncio.open_connection(*await self._where())
        self.state = f"connected to {self._place}"
        try:
            while data := await reader.read(READ_BYTES):
                deliver(Packet(self._source, self._address, "", now_ns(), data))
                await asyncio.sleep(0.0)
        finally:
            writer.close()
