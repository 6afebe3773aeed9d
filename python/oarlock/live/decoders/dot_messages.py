"""Commands and messages of Movella DOT (Xsens DOT) over Bluetooth, for its decoder and its transport.

Source: Movella, "Movella DOT BLE Services Specification" (XD0506P, revision C). Set the output rate, subscribe to
notifications, then start: in another order the unit sends nothing.
"""

from __future__ import annotations

import struct

RATES_HZ = (1, 4, 10, 12, 15, 20, 30, 60)


def start(mode: int) -> bytes:
    """Starts measuring: to be written to characteristic 2001, after notifications were subscribed to."""
    return bytes((1, 1, mode))


def stop(mode: int) -> bytes:
    """Stops measuring: to be written to characteristic 2001."""
    return bytes((1, 0, mode))


def output_rate(rate_hz: int) -> bytes:
    """Sets the output rate: to be written to characteristic 1002 before measuring starts.

    The first byte says which setting is meant; the others stay as they are.

    Raises:
        ValueError: the units have no such rate.
    """
    if rate_hz not in RATES_HZ:
        raise ValueError(f"rate_hz is {rate_hz}; expected one of {', '.join(map(str, RATES_HZ))}")
    return struct.pack("<B23xH6x", 0x10, rate_hz)


def message(service: int, content: bytes) -> bytes:
    """A message for characteristic 7001: service, length, content, and a byte that makes the sum of all 0 mod 256.

    Args:
        service: 1 recording, 2 synchronisation, 3 device.
        content: a message's number and what belongs to it.
    """
    told = bytes((service, len(content))) + content
    return told + bytes((-sum(told) % 256,))


def message_of(data: bytes) -> tuple[int, bytes] | None:
    """Service and content of a message, such as an answer from 7002 or 7003; None if it is damaged."""
    size = 3 + data[1] if len(data) > 2 else 0
    if not 3 < size <= len(data) or sum(data[:size]) % 256 or any(data[size:]):
        return None
    return data[0], data[2 : size - 1]
