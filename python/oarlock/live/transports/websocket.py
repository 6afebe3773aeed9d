"""Messages of a WebSocket that a device or a program serves, such as the page of Open Rowing Monitor."""

from __future__ import annotations

from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus

from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver, Options, again_and_again, now_ns
from oarlock.storage.errors import DataError

LONGEST = 1 << 20
"""A longer message ends the connection; it is none of a device."""
ANSWERS_S = 10.0
"""A server that answers neither the connection nor a ping for so long is lost."""


class WebSocket:
    """Connects to a server, and again when it is lost. Option: `url`, such as `ws://192.168.1.20/websocket`.

    The address of a device is `host:port` of the server.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("url")
        self.source, self.url = source, options.text("url")
        self.address = _address(source, self.url)
        self.state = "not started"

    async def run(self, deliver: Deliver) -> None:
        """Delivers each message as a packet until it is cancelled."""
        await again_and_again(self, lambda: self._connected(deliver), self.url)

    async def _connected(self, deliver: Deliver) -> None:
        try:
            # A proxy of the system is for the internet, not for a device beside the athlete.
            async with connect(
                self.url,
                compression=None,
                proxy=None,
                max_size=LONGEST,
                open_timeout=ANSWERS_S,
                ping_interval=ANSWERS_S,
                ping_timeout=ANSWERS_S,
            ) as socket:
                self.state = f"connected to {self.url}"
                async for message in socket:
                    data = message.encode() if isinstance(message, str) else message
                    deliver(Packet(self.source, self.address, "", now_ns(), data))
        except InvalidStatus as error:
            raise OSError(f"the server answers with status {error.response.status_code}") from error
        except InvalidHandshake as error:
            raise OSError("what answers there is no WebSocket") from error
        except ConnectionClosed as error:
            raise OSError(f"the connection broke: {error}") from error


def _address(source: str, url: str) -> str:
    """Host and port of a URL.

    Raises:
        DataError: it is no URL of a WebSocket.
    """
    try:
        parts = urlsplit(url)
        port = parts.port or {"ws": 80, "wss": 443}[parts.scheme]
    except (ValueError, KeyError):
        parts, port = None, 0
    if parts is None or not parts.hostname or parts.fragment:
        raise DataError(
            f"source '{source}': the option url is {url!r}; expected ws://HOST:PORT/PATH, or wss://..."
        )
    return f"{parts.hostname}:{port}"
