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
COMMAND_PAUSE_S = 0.1
"""A unit gets so much time for a command before the next."""


class Serial:
    """Reads a serial line, and opens it again after a loss.

    Options: `device`, such as /dev/ttyUSB0; `baud`; `first` and `last`, lists of commands in hexadecimal digits, which
    are sent when the line has been opened and before it is closed. A Shimmer3 has them by itself.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check("device", "baud", "first", "last")
        self.source, self.device, self.baud = source, options.text("device"), options.integer("baud", 115200)
        self.state = "not started"
        self._first, self._last = (_commands(options, key) for key in ("first", "last"))
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
            with line:
                for command in self._first:
                    line.write(command)
                    ended.wait(COMMAND_PAUSE_S)
                while not ended.is_set():
                    if data := line.read(1):
                        arrival_ns, rest = now_ns(), line.read(line.in_waiting)
                        packet = Packet(self.source, self.device, "", arrival_ns, data + rest)
                        loop.call_soon_threadsafe(deliver, packet)
                for command in self._last:
                    line.write(command)

        try:
            await loop.run_in_executor(None, read)
        finally:
            ended.set()

    def _opened(self) -> Any:
        return self._serial.serial_for_url(self.device, self.baud, timeout=WAIT_S, exclusive=True)


def _commands(options: Options, key: str) -> tuple[bytes, ...]:
    try:
        return tuple(bytes.fromhex(text) for text in options.texts(key)) if key in options.values else ()
    except ValueError as error:
        raise DataError(
            f"source '{options.source}': {key} is {options.values[key]!r}; expected pairs of hexadecimal digits"
        ) from error
