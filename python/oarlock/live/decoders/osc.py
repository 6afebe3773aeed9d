"""Reads and writes packets of Open Sound Control: messages and bundles, for the decoders of units that send them.

Source: M. Wright, The Open Sound Control 1.0 Specification (2002); SLIP on serial ports: RFC 1055.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from oarlock.formats.devices.ximu3_messages import unstuffed

Argument = float | bool | str | bytes
SLIP_END = b"\xc0"
UNIX_EPOCH_S = 2_208_988_800
"""Of 1970, in the seconds since 1900 of time tags."""
_IMMEDIATELY = 1
_BUNDLE = b"#bundle\0"
_DEEPEST = 8
_NUMBERS = {"i": ">i", "f": ">f", "d": ">d", "h": ">q", "t": ">Q"}
_PLAIN = {"T": True, "F": False}


class OscMessage(NamedTuple):
    """A message, with the time tag of its bundle: 2^-32 s since 1900, or None."""

    tag: int | None
    address: str
    arguments: tuple[Argument, ...]


def messages(packet: bytes) -> list[OscMessage] | None:
    """The messages of a packet; None if any is malformed, or has an argument other than i f d T F s b h t."""
    try:
        return _messages(packet, None, 0)
    except (ValueError, struct.error, KeyError):
        return None


def unslipped(frame: bytes) -> bytes | None:
    """The packet of a SLIP frame without its ends; None if it is damaged."""
    return unstuffed(frame, SLIP_END)


def seconds(tag: int | None) -> float | None:
    """A time tag as seconds since 1970; since the start of the unit, if its tags count from there."""
    if tag is None:
        return None
    return (tag - (UNIX_EPOCH_S << 32) if tag >= UNIX_EPOCH_S << 32 else tag) / 2**32


def message(address: str, arguments: Sequence[float | str]) -> bytes:
    """The packet of one message, with float32 for numbers.

    Args:
        address: begins with "/".
        arguments: numbers and texts.
    """
    kinds = "".join("s" if isinstance(value, str) else "f" for value in arguments)
    body = b"".join(_padded(v.encode()) if isinstance(v, str) else struct.pack(">f", v) for v in arguments)
    return _padded(address.encode("ascii")) + _padded(f",{kinds}".encode()) + body


def bundle(tag: int, packets: Sequence[bytes]) -> bytes:
    """Packets with a common time tag."""
    sized = b"".join(struct.pack(">I", len(packet)) + packet for packet in packets)
    return _BUNDLE + struct.pack(">Q", tag) + sized


def _messages(packet: bytes, tag: int | None, depth: int) -> list[OscMessage]:
    if not packet.startswith(_BUNDLE):
        return [_message(packet, tag)]
    if depth > _DEEPEST:
        raise ValueError("too deep")
    (own,) = struct.unpack_from(">Q", packet, len(_BUNDLE))
    tag = None if own == _IMMEDIATELY else own
    found: list[OscMessage] = []
    at = 16
    while at < len(packet):
        (size,) = struct.unpack_from(">I", packet, at)
        at += 4 + size
        if at > len(packet):
            raise ValueError("cut off")
        found += _messages(packet[at - size : at], tag, depth + 1)
    return found


def _message(packet: bytes, tag: int | None) -> OscMessage:
    address, at = _text(packet, 0)
    kinds, at = _text(packet, at)
    if not address.startswith("/") or not kinds.startswith(","):
        raise ValueError("no message")
    arguments: list[Argument] = []
    for kind in kinds[1:]:
        value, at = (_PLAIN[kind], at) if kind in _PLAIN else _argument(packet, at, kind)
        arguments.append(value)
    if at != len(packet):
        raise ValueError("bytes behind the last argument")
    return OscMessage(tag, address, tuple(arguments))


def _argument(packet: bytes, at: int, kind: str) -> tuple[Argument, int]:
    if kind == "s":
        return _text(packet, at)
    if kind == "b":
        (size,) = struct.unpack_from(">I", packet, at)
        end = at + 4 + size + -size % 4
        if end > len(packet):
            raise ValueError("cut off")
        return packet[at + 4 : at + 4 + size], end
    form = _NUMBERS[kind]
    return struct.unpack_from(form, packet, at)[0], at + struct.calcsize(form)


def _text(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.index(b"\0", at)
    text = packet[at:end].decode()
    return text, end + 4 - end % 4


def _padded(text: bytes) -> bytes:
    return text + bytes(4 - len(text) % 4)
