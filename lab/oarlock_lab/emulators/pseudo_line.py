"""A serial line that is not there: a pseudo-terminal with a lasting name, for the carriers of emulators."""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import termios
import tty
from collections.abc import Callable
from pathlib import Path

READ_BYTES = 4096
MOST_WAITING_BYTES = 1 << 16
"""So much waits for a slow reader; the kernel has 4 KB."""


class PseudoLine:
    """The device's end of a line. What is sent while nobody has opened the other end is lost, as on a cable.

    Args:
        path: where the line appears, as a symbolic link; one that is there is replaced.
        answer: to what is written into the line; None to ignore it.
    """

    def __init__(self, path: Path, answer: Callable[[bytes], bytes] | None) -> None:
        self.path, self._answer = path, answer
        self._master, line = os.openpty()
        if path.is_symlink():
            path.unlink()
        path.symlink_to(os.ttyname(line))
        # From now on the kernel tells by a hang-up that nobody has the line open.
        os.close(line)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        self._loop = asyncio.get_running_loop()
        self._was_open = False
        self._waiting = bytearray()

    def is_open(self) -> bool:
        """Whether somebody has opened it."""
        is_open = not any(event & select.POLLHUP for _, event in self._poll.poll(0))
        if is_open and not self._was_open:
            if termios.tcgetattr(self._master)[3] & termios.ECHO:
                tty.setraw(self._master)
            self._loop.add_reader(self._master, self._read)
        elif self._was_open and not is_open:
            self._leave()
        self._was_open = is_open
        return is_open

    def send(self, data: bytes) -> None:
        """Sends all of the data or nothing of it."""
        if self.is_open() and len(self._waiting) + len(data) <= MOST_WAITING_BYTES:
            self._waiting += data
            self._write()

    def close(self) -> None:
        """Ends the line."""
        self._leave()
        os.close(self._master)
        self.path.unlink(missing_ok=True)

    def _read(self) -> None:
        try:
            data = os.read(self._master, READ_BYTES)
        except OSError:  # closed just now
            self.is_open()
            return
        if self._answer is not None:
            self.send(self._answer(data))

    def _write(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._waiting:
                del self._waiting[: os.write(self._master, self._waiting)]
        if self._waiting:
            self._loop.add_writer(self._master, self._write)
        else:
            self._loop.remove_writer(self._master)

    def _leave(self) -> None:
        self._loop.remove_reader(self._master)
        self._loop.remove_writer(self._master)
        self._waiting.clear()
