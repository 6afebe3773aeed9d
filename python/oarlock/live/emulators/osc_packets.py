"""Writes packets of Open Sound Control, for the emulators that send them.

Sources: M. Wright, The Open Sound Control 1.0 Specification (2002); SLIP on serial lines: RFC 1055. Written apart from
the decoders, so that each checks the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from struct import pack


def osc_message(address: str, numbers: Sequence[float]) -> bytes:
    """Address, types and float32, each part padded with zeros to a multiple of 4 bytes."""
    kinds = "," + "f" * len(numbers)
    return _text(address) + _text(kinds) + pack(f">{len(numbers)}f", *numbers)


def osc_bundle(seconds: float, messages: Iterable[bytes]) -> bytes:
    """Messages with the time tag of their values: seconds and 2^-32 s."""
    tag = round(seconds * 2**32)
    return _text("#bundle") + pack(">Q", tag) + b"".join(pack(">I", len(m)) + m for m in messages)


def slip(packet: bytes) -> bytes:
    """A packet between two ends, for a serial line."""
    plain = packet.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
    return b"\xc0" + plain + b"\xc0"


def _text(text: str) -> bytes:
    data = text.encode("ascii") + b"\0"
    return data + b"\0" * (-len(data) % 4)
