"""Carries the messages of emulated devices: datagrams, servers, WebSockets, an MQTT broker, serial lines."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from websockets.asyncio.server import ServerConnection, broadcast, serve

from oarlock.storage.errors import DataError
from oarlock_lab.emulators.emulated import Destination, DeviceMessage, Emulated, UnitAddress

if TYPE_CHECKING:
    from oarlock_lab.emulators.pseudo_line import PseudoLine


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


READ_BYTES = 4096
LOOK_S = 0.01


class Carrier(Protocol):
    """A way to a receiver."""

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        """Opens what it needs, which `closed` closes."""

    async def connected(self) -> None:
        """Waits until somebody listens, where that can be known."""

    def send(self, unit: str, data: bytes) -> None:
        """Sends to who listens; what nobody takes is lost, as on a real line."""


async def carry(
    emulated: Emulated, units: Sequence[str], messages: Iterable[DeviceMessage], answer: Answer | None = None
) -> None:
    """Sends each message when it is due, until all are sent or it is cancelled.

    By TCP and serial line the first message is due when somebody connects.

    Args:
        emulated: place, and who is told of it.
        units: names, in the order of their ports or lines.
        messages: in the order of arrival.
        answer: to what is sent to a unit by TCP or its serial line.

    Raises:
        DataError: a port or a line cannot be opened.
    """
    carrier = _CARRIERS[emulated.place.transport](answer)
    with contextlib.ExitStack() as closed:
        try:
            await carrier.open(emulated, units, closed)
        except OSError as error:
            where = error.filename or f"{emulated.place.host}:{emulated.place.port}"
            raise DataError(f"{where} cannot be opened for an emulated device ({error.strerror})") from error
        await carrier.connected()
        async for message in paced(messages):
            carrier.send(message.unit, message.data)


class Due(Protocol):
    """What is sent at a time."""

    @property
    def due_s(self) -> float:
        """When it arrives, s from the start."""


D = TypeVar("D", bound=Due)


async def paced(messages: Iterable[D]) -> AsyncIterator[D]:
    """Each message when it is due; the first is due now."""
    begun_s = None
    for message in messages:
        # To make the first message may take a while, which is not the devices' delay.
        begun_s = time.monotonic() - message.due_s if begun_s is None else begun_s
        while (early_s := begun_s + message.due_s - time.monotonic()) > 0.0:
            await asyncio.sleep(early_s)
        yield message


def senders(place: Destination, name: str, units: Sequence[str]) -> dict[str, UnitAddress]:
    """How a receiver on this machine finds each unit.

    Args:
        place: where they send, with transport and port.
        name: of the source in a rig file; numbered where each unit has a source of its own.
        units: names, in the order of their ports or lines.
    """
    found = {}
    for k, unit in enumerate(units):
        own = name if len(units) == 1 else f"{name}_{k + 1}"
        host, port, path = place.host, port_of(place, k), str(line_path(place, k))
        if place.transport == "udp":
            found[unit] = UnitAddress(name, "udp", {"port": place.port, "host": host}, f"{host}:{port}")
        elif place.transport == "tcp":
            found[unit] = UnitAddress(own, "tcp", {"host": host, "port": port}, f"{host}:{port}")
        else:
            found[unit] = UnitAddress(own, "serial", {"device": path}, path)
    return found


def port_of(place: Destination, number: int) -> int:
    """The own port of a unit: at which it serves (TCP), or from which it sends (UDP), behind the receiver's port."""
    assert place.port is not None
    return place.port + number + (place.transport == "udp")


def line_path(place: Destination, number: int) -> Path:
    """Where the serial line of a unit appears."""
    first = place.path or Path("oarlock-line")
    return first.with_name(f"{first.name}-{number + 1}") if number else first


class _Datagrams:
    def __init__(self, answer: Answer | None) -> None:
        self._sockets: dict[str, socket.socket] = {}

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        place = emulated.place
        for k, unit in enumerate(units):
            own = closed.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            own.bind(("", port_of(place, k)))
            self._sockets[unit] = own
        self._to = (place.host, place.port)
        emulated.say(f"sends to {place.host}:{place.port} from port {port_of(place, 0)}")

    async def connected(self) -> None:
        pass

    def send(self, unit: str, data: bytes) -> None:
        # The answer that nobody listens there comes with a later datagram.
        with contextlib.suppress(ConnectionError):
            self._sockets[unit].sendto(data, self._to)


class _Served:
    def __init__(self, answer: Answer | None) -> None:
        self._answer = answer
        self._listeners: dict[str, set[asyncio.StreamWriter]] = {}
        self._connected = asyncio.Event()

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        for k, unit in enumerate(units):
            self._listeners[unit] = set()
            port = port_of(emulated.place, k)
            serve = self._serving(unit)
            server = await asyncio.start_server(serve, emulated.place.host, port)
            closed.callback(server.close)
            emulated.say(f"{unit or 'it'} serves at {emulated.place.host}:{port}")
        closed.callback(self._hang_up)

    def _serving(self, unit: str) -> Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            self._listeners[unit].add(writer)
            self._connected.set()
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(READ_BYTES):
                    writer.write(self._answer(unit, data) if self._answer else b"")
            self._listeners[unit].discard(writer)
            writer.close()

        return serve

    def _hang_up(self) -> None:
        for writers in self._listeners.values():
            for writer in writers:
                writer.close()

    async def connected(self) -> None:
        await self._connected.wait()

    def send(self, unit: str, data: bytes) -> None:
        for writer in self._listeners[unit]:
            writer.write(data)


class _SerialLines:
    def __init__(self, answer: Answer | None) -> None:
        self._answer = answer
        self._lines: dict[str, PseudoLine] = {}

    async def open(self, emulated: Emulated, units: Sequence[str], closed: contextlib.ExitStack) -> None:
        from oarlock_lab.emulators.pseudo_line import PseudoLine

        for k, unit in enumerate(units):
            answer = None if self._answer is None else partial(self._answer, unit)
            line = PseudoLine(line_path(emulated.place, k), answer)
            closed.callback(line.close)
            self._lines[unit] = line
            emulated.say(f"{unit or 'it'} is the serial line {line.path}")

    async def connected(self) -> None:
        while not any(line.is_open() for line in self._lines.values()):
            await asyncio.sleep(LOOK_S)

    def send(self, unit: str, data: bytes) -> None:
        self._lines[unit].send(data)


_CARRIERS: dict[str, Callable[[Answer | None], Carrier]] = {
    "udp": _Datagrams,
    "tcp": _Served,
    "serial": _SerialLines,
    "websocket": WebSocketPage,
    "mqtt": Published,
}
