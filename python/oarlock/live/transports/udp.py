"""Datagrams to a port of this machine."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from pathlib import Path
from typing import Any

from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver, Options, now_ns
from oarlock.storage.errors import DataError

BUFFER_BYTES = 4 << 20
"""Asked of the kernel, so that a pause of this program loses nothing; it grants what its limits allow."""


class Udp:
    """Listens at a port. Options: `port`; `host`, the address of this machine, else all of them.

    The address of a device is `host:port` of the sender.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("host", "port")
        self.source, self.host, self.port = source, options.text("host", "0.0.0.0"), options.port()
        self.state = "not started"
        self._socket: socket.socket | None = None

    async def run(self, deliver: Deliver) -> None:
        """Delivers each datagram as a packet until it is cancelled."""
        loop = asyncio.get_running_loop()
        self._socket = self._bound()
        self.port = self._socket.getsockname()[1]
        transport, _ = await loop.create_datagram_endpoint(
            lambda: _Receiver(self.source, deliver), sock=self._socket
        )
        self.state = f"listens at port {self.port}"
        try:
            await asyncio.Event().wait()
        finally:
            transport.close()

    def _bound(self) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        try:
            made.bind((self.host, self.port))
        except OSError as error:
            made.close()
            raise DataError(
                f"source '{self.source}': port {self.port} at {self.host} cannot be opened ({error.strerror}). "
                "Another program may listen there: end it, or send to another port"
            ) from error
        made.setblocking(False)
        return made

    @property
    def dropped(self) -> int | None:
        """Datagrams that the kernel dropped because its buffer was full; None where it does not say."""
        if self._socket is None or self._socket.fileno() < 0:
            return None
        inode = str(Path(f"/proc/self/fd/{self._socket.fileno()}").resolve()).rpartition("[")[2].rstrip("]")
        with contextlib.suppress(OSError):
            for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
                cells = line.split()
                if cells[9] == inode:
                    return int(cells[12])
        return None


def free_port() -> int:
    """A port of this machine at which nothing listens now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, source: str, deliver: Deliver) -> None:
        self._source, self._deliver = source, deliver

    def datagram_received(self, data: bytes, addr: tuple[str | Any, int]) -> None:
        self._deliver(Packet(self._source, f"{addr[0]}:{addr[1]}", "", now_ns(), data))
