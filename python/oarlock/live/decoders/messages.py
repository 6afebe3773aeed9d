"""Cuts bytes into messages at a delimiter, for the decoders whose messages end with one."""

from __future__ import annotations

from collections.abc import Callable

from oarlock.live.reading import Reading

MOST_BYTES = 4096
"""Longer messages are damaged: their delimiter was lost."""


class MessageDecoder:
    """Decodes a stream of messages, each of which ends with the same byte.

    Args:
        read: the readings of one message; None if it is damaged.
        end: the byte that ends a message and is in none; b"" if each call of `decode` has one message.
        datagrams: each call of `decode` has whole messages, of which the last may lack its end, as in UDP.
    """

    def __init__(
        self, read: Callable[[bytes], list[Reading] | None], end: bytes = b"\n", *, datagrams: bool = False
    ) -> None:
        self.damaged = 0
        self._read, self._end, self._datagrams = read, end, datagrams
        self._rest = b""

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings that these bytes complete, in the order of their messages."""
        found: list[Reading] = []
        for message in self._whole(data):
            readings = self._read(message) if len(message) <= MOST_BYTES else None
            if readings is None:
                self.damaged += 1
            else:
                found += readings
        return found

    def _whole(self, data: bytes) -> list[bytes]:
        if not self._end:
            return [data]
        *whole, rest = (self._rest + data).split(self._end)
        if self._datagrams:
            return [message for message in (*whole, rest) if message]
        # One byte too many is enough to know that it is too long.
        self._rest = rest[: MOST_BYTES + 1]
        return [message for message in whole if message]
