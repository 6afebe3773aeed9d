"""Datagrams to a port of this machine."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from oarlock.live.decoders.ximu3_announcement import Announcement
from oarlock.live.reading import Packet
from oarlock.live.transports.announced import Announcements
from oarlock.live.transports.transport import Deliver, Options, now_ns
from oarlock.storage.errors import DataError

BUFFER_BYTES = 4 << 20
"""Asked of the kernel, so that a pause of this program loses nothing; it grants what its limits allow."""
LONGEST, MOST_AT_ONCE = 65_536, 256
_SO_TIMESTAMPNS = 35
"""Linux, asm-generic/socket.h: the kernel says when it received a datagram, so that a busy program delays no stamp."""
_TIMESPEC = struct.Struct("@ll")
_TOLD_BYTES = 64


class Udp:
    """Listens at a port. Options: `port`; `host`, the address of this machine, else all of them; `units`.

    The address of a device is `host:port` of the sender; of x-IMU3 units whose serial numbers or names are `units`,
    it is that word, once they have announced themselves.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("host", "port", "units")
        self._units = (
            {unit.casefold(): unit for unit in options.texts("units")} if "units" in options.values else {}
        )
        self._names: dict[str, str] = {}
        self.source, self.host, self.port = source, options.text("host", "0.0.0.0"), options.port()
        self.state = "not started"
        self._socket: socket.socket | None = None
        self._last_ns = 0

    async def run(self, deliver: Deliver) -> None:
        """Delivers each datagram as a packet until it is cancelled."""
        async with contextlib.AsyncExitStack() as stack:
            if self._units:
                await self._hear_names(stack)
            await self._listen(deliver)

    async def _hear_names(self, stack: contextlib.AsyncExitStack) -> None:
        try:
            await stack.enter_async_context(Announcements(self._name))
        except OSError as error:
            raise DataError(
                f"source '{self.source}': cannot hear which x-IMU3 units there are ({error.strerror}). "
                "Leave units out, and name devices by their addresses"
            ) from error

    def _name(self, unit: Announcement) -> None:
        for word in (unit.serial.casefold(), unit.name.casefold()):
            if word in self._units:
                self._names[unit.address] = self._units[word]

    async def _listen(self, deliver: Deliver) -> None:
        loop = asyncio.get_running_loop()
        self._socket = self._bound()
        self.port = self._socket.getsockname()[1]
        try:
            loop.add_reader(self._socket, self._receive, self._socket, deliver)
        except NotImplementedError:  # the usual loop of Windows watches no sockets
            await loop.create_datagram_endpoint(lambda: _Receiver(self, deliver), sock=self._socket)
        self.state = f"listens at port {self.port}"
        try:
            await asyncio.Event().wait()
        finally:
            with contextlib.suppress(NotImplementedError):
                loop.remove_reader(self._socket)
            self._socket.close()

    def _receive(self, bound: socket.socket, deliver: Deliver) -> None:
        """All datagrams that wait, with the time at which the kernel received each."""
        for _ in range(MOST_AT_ONCE):
            try:
                data, told, _, sender = bound.recvmsg(LONGEST, _TOLD_BYTES)
            except (BlockingIOError, ConnectionError):
                return
            # Datagrams come in their order; a clock of the day that is set meanwhile would say otherwise.
            self._last_ns = max(self._last_ns, _arrival_ns(told))
            deliver(self.packet(sender, self._last_ns, data))

    def packet(self, sender: tuple[str | Any, int], arrival_ns: int, data: bytes) -> Packet:
        """A datagram as a packet."""
        address = self._names.get(sender[0]) or f"{sender[0]}:{sender[1]}"
        return Packet(self.source, address, "", arrival_ns, data)

    def _bound(self) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                made.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        try:
            made.bind((self.host, self.port))
        except OSError as error:
            made.close()
            raise DataError(
                f"source '{self.source}': port {self.port} at {self.host} cannot be opened ({error.strerror}). "
                "Another program may listen there, such as a session that still runs: end it, or give this source "
                "another port in the rig file and let the devices send there"
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


def _arrival_ns(told: Sequence[tuple[int, int, bytes]]) -> int:
    """When the kernel received a datagram; now, where it does not say."""
    for _, kind, data in told:
        if kind == _SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            waited_ns = time.time_ns() - (seconds * 10**9 + nanoseconds)
            # The clock of the day may have been set since.
            return now_ns() - waited_ns if 0 <= waited_ns < 10**10 else now_ns()
    return now_ns()


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, udp: Udp, deliver: Deliver) -> None:
        self._udp, self._deliver = udp, deliver

    def datagram_received(self, data: bytes, addr: tuple[str | Any, int]) -> None:
        self._deliver(self._udp.packet(addr, now_ns(), data))
