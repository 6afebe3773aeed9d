"""Messages of a topic of an MQTT broker, by paho-mqtt (`oarlock[mqtt]`)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.live.reading import RETAINED, Packet
from oarlock.live.transports.transport import Deliver, Options, again_and_again, now_ns
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_text

if TYPE_CHECKING:
    from paho.mqtt.client import Client

PORT, PORT_TLS = 1883, 8883
ANSWERS_S = 10
"""A broker that does not answer for so long is lost."""
STEP_S = 0.1
_Told = Callable[[str, str, bytes], None]


class Mqtt:
    """Listens to a topic, and connects again when the broker is lost.

    Options: `host` and `port` of the broker; `topic`, with `+` or `#` for several devices; `username`, and
    `password_file`, whose first line is the password; `tls`, true for an encrypted connection. The address of a device
    is its topic.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("host", "port", "topic", "username", "password_file", "tls")
        self.source, self.host, self.topic = source, options.text("host"), options.text("topic")
        self.tls = options.values.get("tls", False) is True
        self.port = options.port(PORT_TLS if self.tls else PORT)
        self.username, self.password = options.text("username", ""), _password(options)
        self.state = "not started"
        if not is_filter(self.topic):
            raise DataError(
                f"source '{source}': the option topic is {self.topic!r}; expected levels between /, each a name or +, "
                "the last also #"
            )
        self._mqtt = _paho(source)

    async def run(self, deliver: Deliver) -> None:
        """Delivers each message as a packet until it is cancelled."""
        await again_and_again(self, lambda: self._connected(deliver), f"the broker {self.host}:{self.port}")

    async def _connected(self, deliver: Deliver) -> None:
        loop, ended = asyncio.get_running_loop(), threading.Event()

        def told(topic: str, channel: str, data: bytes) -> None:
            loop.call_soon_threadsafe(deliver, Packet(self.source, topic, channel, now_ns(), data))

        try:
            await loop.run_in_executor(None, self._listen, told, ended)
        finally:
            ended.set()

    def _listen(self, told: _Told, ended: threading.Event) -> None:
        """In a thread of its own: the usual event loop of Windows cannot watch the client's socket."""
        client, refused = self._client(told)
        client.connect(self.host, self.port, keepalive=ANSWERS_S)
        try:
            while not ended.is_set():
                result = client.loop(STEP_S)
                if refused:
                    raise OSError(refused[0])
                if result != self._mqtt.MQTT_ERR_SUCCESS:
                    raise OSError(self._mqtt.error_string(result))
        finally:
            client.disconnect()

    def _client(self, told: _Told) -> tuple[Client, list[str]]:
        """A client that listens as soon as it is connected, and what the broker refuses."""
        refused: list[str] = []

        def connected(client: Client, _: object, __: object, reason: Any, ___: object) -> None:
            if reason.is_failure:
                refused.append(f"it refuses the connection: {reason}; see username and password_file")
            else:
                client.subscribe(self.topic)

        def subscribed(_: object, __: object, ___: object, reasons: list[Any], ____: object) -> None:
            if any(reason.is_failure for reason in reasons):
                refused.append(f"it refuses the topic {self.topic}")
            else:
                self.state = f"listens to {self.topic} at {self.host}:{self.port}"

        def heard(_: object, __: object, message: Any) -> None:
            told(message.topic, RETAINED if message.retain else "", message.payload)

        client: Client = self._mqtt.Client(self._mqtt.CallbackAPIVersion.VERSION2)
        client.on_connect, client.on_subscribe, client.on_message = connected, subscribed, heard
        if self.tls:
            client.tls_set()
        if self.username:
            client.username_pw_set(self.username, self.password)
        return client, refused


def is_filter(topic: str) -> bool:
    """Whether a text selects topics (MQTT 3.1.1, section 4.7): wildcards are whole levels, `#` only the last."""
    levels = topic.split("/")
    wild = all(level in ("+", "#") or not set(level) & set("+#") for level in levels)
    return (
        bool(topic)
        and wild
        and "#" not in levels[:-1]
        and "\0" not in topic
        and len(topic.encode()) < 1 << 16
    )


def _password(options: Options) -> str | None:
    """The first line of the file; a rig file, which stays with the recording, is no place for a password."""
    file = options.text("password_file", "")
    if not file:
        return None
    try:
        return read_text(Path(file).expanduser()).split("\n")[0]
    except DataError as error:
        raise DataError(
            f"source '{options.source}': the password_file {file} cannot be read ({error})"
        ) from error


def _paho(source: str) -> Any:
    try:
        return import_module("paho.mqtt.client")
    except ImportError as error:
        raise DataError(f"source '{source}': MQTT needs paho-mqtt: pip install 'oarlock[mqtt]'") from error
