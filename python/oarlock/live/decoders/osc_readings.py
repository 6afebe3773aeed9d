"""Decodes Open Sound Control of sensors that somebody built: the last part of an address is the name of a quantity.

`/left/hand/gyro_rad_s` with three numbers is the device `left/hand`. What a bundle has of one device is one
reading, and its time tag is the reading's clock.
"""

from __future__ import annotations

from collections.abc import Callable

from oarlock.live.decoders.messages import MessageDecoder
from oarlock.live.decoders.osc import SLIP_END, Argument, OscMessage, messages, seconds, unslipped
from oarlock.live.decoders.quantities import are_sound
from oarlock.live.reading import Reading, Value


def decoder(*, datagrams: bool = False) -> MessageDecoder:
    """A decoder of one sender.

    Args:
        datagrams: each call has one packet, as in UDP; else packets come in SLIP frames, as on serial ports.
    """
    return osc_decoder(readings, datagrams=datagrams)


def osc_decoder(
    read: Callable[[list[OscMessage]], list[Reading] | None], *, datagrams: bool
) -> MessageDecoder:
    """A decoder of OSC packets.

    Args:
        read: the readings of the messages of a packet; None if they are damaged.
        datagrams: each call has one packet; else packets come in SLIP frames.
    """

    def packet(data: bytes) -> list[Reading] | None:
        plain = data if datagrams else unslipped(data)
        found = None if plain is None else messages(plain)
        return None if found is None else read(found)

    return MessageDecoder(packet, b"" if datagrams else SLIP_END)


def readings(found: list[OscMessage]) -> list[Reading] | None:
    """A reading for each device and time tag of a packet; None if a quantity is not what its name says."""
    grouped: dict[tuple[int | None, str], dict[str, Value]] = {}
    for tag, address, arguments in found:
        device, _, name = address.strip("/").rpartition("/")
        value = value_of(arguments)
        if value is None or not are_sound({name: value}):
            return None
        grouped.setdefault((tag, device), {})[name] = value
    return [Reading(device, seconds(tag), values) for (tag, device), values in grouped.items()]


def value_of(arguments: tuple[Argument, ...]) -> Value | None:
    """Numbers as a number or a tuple, or one text; None for all else."""
    if len(arguments) == 1 and isinstance(arguments[0], str):
        return arguments[0]
    numbers = tuple(float(one) for one in arguments if isinstance(one, int | float))
    if not numbers or len(numbers) != len(arguments):
        return None
    return numbers if len(numbers) > 1 else numbers[0]
