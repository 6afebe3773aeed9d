"""A small MQTT 3.1.1 broker with what the tests need: QoS 0, one topic filter a client, retained messages, passwords.

Written from OASIS, "MQTT Version 3.1.1". Where mosquitto is installed, the tests run with it, too.
"""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager, suppress

CONNECT, CONNACK, PUBLISH, SUBSCRIBE, SUBACK, PINGREQ, PINGRESP, DISCONNECT = 1, 2, 3, 8, 9, 12, 13, 14
NOT_AUTHORISED, REFUSED = 5, 0x80


class Broker:
    """Listens at `port` of this machine; `drop()` ends all connections, as a restart does."""

    def __init__(self, login=None, refused_topic=""):
        self.login, self.refused_topic = login, refused_topic
        self.retained, self.listeners, self.connections = {}, {}, 0
        self.port = 0

    @asynccontextmanager
    async def there(self):
        server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = server.sockets[0].getsockname()[1]
        try:
            yield self
        finally:
            server.close()
            self.drop()
            await server.wait_closed()

    def drop(self):
        for writer in list(self.listeners):
            writer.close()

    async def _serve(self, reader, writer):
        self.listeners[writer] = ""
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                head = (await reader.readexactly(1))[0]
                body = await reader.readexactly(await _length(reader))
                if head >> 4 == DISCONNECT or not self._answer(writer, head, body):
                    break
        self.listeners.pop(writer, None)
        writer.close()

    def _answer(self, writer, head, body):
        kind = head >> 4
        if kind == CONNECT:
            self.connections += 1
            is_known = self.login is None or self.login == _login(body)
            writer.write(_packet(CONNACK << 4, bytes([0, 0 if is_known else NOT_AUTHORISED])))
            return is_known
        if kind == SUBSCRIBE:
            topic, _ = _text(body, 2)
            is_refused = topic == self.refused_topic
            writer.write(_packet(SUBACK << 4, body[:2] + bytes([REFUSED if is_refused else 0])))
            if not is_refused:
                self.listeners[writer] = topic
                for name, data in self.retained.items():
                    self._send(writer, name, data, 1)
        if kind == PUBLISH:
            topic, at = _text(body, 0)
            if head & 1:
                self.retained[topic] = body[at:]
            for listener in self.listeners:
                self._send(listener, topic, body[at:], 0)
        if kind == PINGREQ:
            writer.write(_packet(PINGRESP << 4, b""))
        return True

    def _send(self, writer, topic, data, retain):
        if _fits(self.listeners[writer], topic):
            name = topic.encode()
            writer.write(_packet(PUBLISH << 4 | retain, len(name).to_bytes(2, "big") + name + data))


async def _length(reader):
    value = shift = 0
    while True:
        byte = (await reader.readexactly(1))[0]
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value


def _packet(head, body):
    size, rest = bytearray(), len(body)
    while True:
        rest, low = divmod(rest, 128)
        size.append(low | (0x80 if rest else 0))
        if not rest:
            return bytes([head]) + bytes(size) + body


def _text(body, at):
    end = at + 2 + int.from_bytes(body[at : at + 2], "big")
    return body[at + 2 : end].decode(), end


def _login(body):
    """User name and password of a CONNECT."""
    flags, at, found = body[7], 10, []
    _, at = _text(body, at)
    for bit in (0x80, 0x40):
        if flags & bit:
            text, at = _text(body, at)
            found.append(text)
    return tuple(found)


def _fits(pattern, topic):
    wanted, levels = pattern.split("/"), topic.split("/")
    if wanted[-1] == "#":
        wanted, levels = wanted[:-1], levels[: len(wanted) - 1]
    return (
        bool(pattern)
        and len(wanted) == len(levels)
        and all(one in ("+", other) for one, other in zip(wanted, levels, strict=True))
    )
