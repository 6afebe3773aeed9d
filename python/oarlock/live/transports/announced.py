"""Hears x-IMU3 units announce themselves in a network: a rig file names a unit, and its address may change."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Any

from oarlock.live.decoders import ximu3_announcement
from oarlock.live.decoders.ximu3_announcement import Announcement, announcement

WAIT_S = 3.0
"""A unit announces itself once a second; one of which nothing came for so long is not there."""


class Announcements(asyncio.DatagramProtocol):
    """The units that announce themselves, from now on.

    Args:
        told: called with each announcement.
    """

    def __init__(self, told: Callable[[Announcement], None] = lambda unit: None) -> None:
        self._told, self._units = told, dict[str, Announcement]()
        self._heard = asyncio.Event()
        self._transport: asyncio.DatagramTransport | None = None

    async def __aenter__(self) -> Announcements:
        """Begin to listen.

        Raises:
            OSError: the port cannot be opened.
        """
        bound = shared_socket(ximu3_announcement.PORT)
        await asyncio.get_running_loop().create_datagram_endpoint(lambda: self, sock=bound)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._transport is not None:
            self._transport.close()

    async def unit(self, name: str) -> Announcement:
        """The newest announcement of a unit.

        Args:
            name: its serial number or name, in any case of letters.

        Raises:
            OSError: it does not announce itself.
        """
        self._units.clear()  # it may have another address by now
        try:
            async with asyncio.timeout(WAIT_S):
                while name.casefold() not in self._units:
                    self._heard.clear()
                    await self._heard.wait()
        except TimeoutError as error:
            raise OSError(f"no x-IMU3 {name} announces itself; is it on, and in this network?") from error
        return self._units[name.casefold()]

    def connection_made(self, transport: Any) -> None:
        """Keep what is to be closed."""
        self._transport = transport

    def datagram_received(self, data: bytes, addr: object) -> None:
        """Take an announcement; what is none is ignored."""
        unit = announcement(data)
        if unit is not None:
            self._units |= {unit.serial.casefold(): unit, unit.name.casefold(): unit}
            self._heard.set()
            self._told(unit)


def shared_socket(port: int) -> socket.socket:
    """A socket at a UDP port at which other programs may listen, too.

    Raises:
        OSError: the port cannot be opened.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "SO_REUSEPORT"):
            with contextlib.suppress(OSError):
                made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        made.bind(("", port))
        made.setblocking(False)
    except OSError:
        made.close()
        raise
    return made
