"""CSAFE frames, by which fitness machines are asked and answer; the PM5 carries them in 0x0021 and 0x0022.

Source: FitLinxx, "CSAFE Protocol Technical Specification"; Concept2, "PM CSAFE Communication Definition",
revision 0.27. A frame is F1, content, exclusive or of the content, F2. Of these, F0 to F3 within a frame are
sent as F3 00 to F3 03. The frame with addresses begins with F0, destination and source, which are not part of
the checksum.
"""

from __future__ import annotations

from functools import reduce
from operator import xor

from oarlock.live.reading import Reading

_EXTENDED = 0xF0
_START = 0xF1
_STOP = 0xF2
_STUFF = 0xF3
# Concept2 allows 120 bytes; twice that leaves room for other makers and ends what is no frame.
_MOST_BYTES = 240


def decoder() -> CsafeDecoder:
    """A decoder of one machine."""
    return CsafeDecoder()


def framed(content: bytes) -> bytes:
    """The frame that sends a content, such as commands."""
    stuffed = bytearray()
    for byte in (*content, checksum(content)):
        stuffed += bytes((_STUFF, byte - _EXTENDED)) if _EXTENDED <= byte <= _STUFF else bytes((byte,))
    return bytes((_START, *stuffed, _STOP))


def checksum(content: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, content, 0)


class CsafeDecoder:
    """Frames of one machine, however its bytes are cut; `content` are the bytes between marks and checksum."""

    def __init__(self) -> None:
        self.damaged = 0
        self._frame: bytearray | None = None
        self._is_stuffed = False
        self._is_lost = False

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings of the frames that these bytes end."""
        return [reading for byte in data for reading in self._after(byte)]

    def _after(self, byte: int) -> list[Reading]:
        if byte in (_START, _EXTENDED):
            self.damaged += self._frame is not None
            self._begin(bytearray((byte,)))
            self._is_lost = False
        elif self._frame is None:
            self._lose()
        elif byte == _STOP:
            return self._ended(self._frame)
        elif byte == _STUFF and not self._is_stuffed:
            self._is_stuffed = True
        elif (self._is_stuffed and byte > 3) or len(self._frame) > _MOST_BYTES:
            self._lose()
        else:
            self._frame.append(byte + _EXTENDED if self._is_stuffed else byte)
            self._is_stuffed = False
        return []

    def _lose(self) -> None:
        """Leave out what is read until the next frame begins; a stretch counts once."""
        self.damaged += not self._is_lost
        self._is_lost = True
        self._begin(None)

    def _begin(self, frame: bytearray | None) -> None:
        self._frame, self._is_stuffed = frame, False

    def _ended(self, frame: bytearray) -> list[Reading]:
        content = bytes(frame[3 if frame[0] == _EXTENDED else 1 :])
        is_whole = not self._is_stuffed and len(content) >= 2 and checksum(content) == 0
        self._begin(None)
        if is_whole:
            return [Reading("", None, {"content": tuple(float(byte) for byte in content[:-1])})]
        self.damaged += 1
        return []
