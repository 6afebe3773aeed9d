"""Carries the messages of emulated devices by WebSocket, to all who have the page open, and to an MQTT broker."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast, serve

from oarlock.live.emulators.emulated import Emulated
from oarlock.storage.errors import DataError

Answer = Callable[[str, bytes], bytes]
"""Unit and what it was sent -> what it replies."""


class WebSocketPage:
    """A server; whatever path is asked for, everybody gets every message as text."""

    def __init__(self, answer: Answer | None) -> None:
        self._viewers: set[ServerConnection] = set()
        self._connected = asyncio.Event()

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        """Listens at the place's port."""
        place = emulated.place
        server = await serve(self._show, place.host, place.port)
        closed.callback(server.close)
        emulated.say(f"serves at ws://{place.host}:{place.port}/websocket")

    async def connected(self) -> None:
        """Waits for the first viewer."""
        await self._connected.wait()

    def send(self, unit: str, data: bytes) -> None:
        """To all viewers; one that is too slow is left out."""
        broadcast(self._viewers, data.decode())

    async def _show(self, viewer: ServerConnection) -> None:
        self._viewers.add(viewer)
        self._connected.set()
        await viewer.wait_closed()
        self._viewers.discard(viewer)


class Published:
    """A client of a broker, by paho-mqtt; a unit is a topic."""

    def __init__(self, answer: Answer | None) -> None:
        try:
            self._mqtt: Any = import_module("paho.mqtt.client")
        except ImportError as error:
            raise DataError("MQTT needs paho-mqtt: pip install 'oarlock[mqtt]'") from error
        self._client = self._mqtt.Client(self._mqtt.CallbackAPIVersion.VERSION2)

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        """Connects to the broker at the place's port; after a loss the client connects again."""
        place, loop = emulated.place, asyncio.get_running_loop()
        await loop.run_in_executor(None, self._client.connect, place.host, place.port)
        self._client.loop_start()
        closed.callback(self._client.loop_stop)
        closed.callback(self._client.disconnect)
        emulated.say(f"publishes {', '.join(units)} at the broker {place.host}:{place.port}")

    async def connected(self) -> None:
        """Nobody can know who listens to a broker."""

    def send(self, unit: str, data: bytes) -> None:
        """Publishes; what the broker cannot take now is lost."""
        self._client.publish(unit, data)
