"""Hears x-IMU3 units announce themselves in a network: a rig file names a unit, and its address may change."""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
import time
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from oarlock.live.decoders import ximu3_announcement
from oarlock.live.decoders.ximu3_announcement import Announcement, announcement

WAIT_S = 3.0
"""A unit announces itself once a second; one of which nothing came for so long is not there."""
Told = Callable[[Announcement], None]


class Announcements:
    """The units that announce themselves, from now on.

    Args:
        told: called with each announcement.
    """

    def __init__(self, told: Told = lambda unit: None) -> None:
        self._told = told
        self._ear: _Ear | None = None

    async def __aenter__(self) -> Announcements:
        """Begin to listen.

        Raises:
            OSError: the port cannot be opened.
        """
        self._ear = await _ear()
        self._ear.listeners.append(self._told)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._ear is not None:
            self._ear.listeners.remove(self._told)
            self._ear.close_unused()

    async def unit(self, name: str) -> Announcement:
        """The newest announcement of a unit.

        Args:
            name: its serial number or name, in any case of letters.

        Raises:
            OSError: it does not announce itself.
        """
        assert self._ear is not None
        try:
            async with asyncio.timeout(WAIT_S):
                while (found := self._ear.newest(name)) is None:
                    self._ear.heard.clear()
                    await self._ear.heard.wait()
                return found
        except TimeoutError as error:
            raise OSError(f"no x-IMU3 {name} announces itself; is it on, and in this network?") from error


class _Ear(asyncio.DatagramProtocol):
    """One socket for all who listen in this process: of several, a datagram of this machine would reach only one."""

    def __init__(self) -> None:
        self.listeners: list[Told] = []
        self.heard = asyncio.Event()
        self._units: dict[str, tuple[float, Announcement]] = {}
        self._transport: asyncio.DatagramTransport | None = None

    def newest(self, name: str) -> Announcement | None:
        at_s, unit = self._units.get(name.casefold(), (-math.inf, None))
        return unit if time.monotonic() - at_s < WAIT_S else None

    def close_unused(self) -> None:
        if not self.listeners and self._transport is not None:
            _EARS.pop(asyncio.get_running_loop(), None)
            self._transport.close()

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: object) -> None:
        unit = announcement(data)
        if unit is None:
            return
        for name in (unit.serial, unit.name):
            self._units[name.casefold()] = (time.monotonic(), unit)
        self.heard.set()
        for told in tuple(self.listeners):
            told(unit)


_EARS: WeakKeyDictionary[asyncio.AbstractEventLoop, _Ear] = WeakKeyDictionary()


async def _ear() -> _Ear:
    loop = asyncio.get_running_loop()
    if loop not in _EARS:
        bound, made = shared_socket(ximu3_announcement.PORT), _Ear()
        _EARS[loop] = made
        await loop.create_datagram_endpoint(lambda: made, sock=bound)
    return _EARS[loop]


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
