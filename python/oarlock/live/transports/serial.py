"""A serial line: USB, or a Bluetooth device that appears as one."""

from __future__ import annotations

import asyncio
import threading
from importlib import import_module
from typing import Any

from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver, Options, again_and_again, now_ns
from oarlock.storage.errors import DataError

WAIT_S = 0.1


class Serial:
    """Reads a serial line, and opens it again after a loss. Options: `device`, such as /dev/ttyUSB0; `baud`."""

    def __init__(self, source: str, options: Options) -> None:
        options.check("device", "baud")
        self.source, self.device, self.baud = source, options.text("device"), options.integer("baud", 115200)
        self.state = "not started"
        try:
            self._serial: Any = import_module("serial")
        except ImportError as error:
            raise DataError(
                f"source '{source}': a serial line needs pyserial: pip install 'oarlock[serial]'"
            ) from error

    async def run(self, deliver: Deliver) -> None:
        """Delivers what arrives together as a packet until it is cancelled."""
        await again_and_again(self, lambda: self._connected(deliver), self.device)

    async def _connected(self, deliver: Deliver) -> None:
        loop, ended = asyncio.get_running_loop(), threading.Event()
        line = await loop.run_in_executor(None, self._opened)
        self.state = f"reads {self.device}"

        def read() -> None:
            while not ended.is_set():
                if data := line.read(max(1, line.in_waiting)):
                    arrival_ns = now_ns()
                    loop.call_soon_threadsafe(deliver, Packet(self.source, self.device, "", arrival_ns, data))

        try:
            await loop.run_in_executor(None, read)
        finally:
            ended.set()
            line.close()

    def _opened(self) -> Any:
        return self._serial.serial_for_url(self.device, self.baud, timeout=WAIT_S, exclusive=True)
