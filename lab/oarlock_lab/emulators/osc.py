"""Emulates sensors that somebody built and that send Open Sound Control, address DEVICE/QUANTITY.

Sources: M. Wright, The Open Sound Control 1.0 Specification (2002); SLIP on serial lines: RFC 1055. Packets are written
apart from the decoders, so that each checks the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from struct import pack

from oarlock.live.simulated_devices import Delivery
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring


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


_UNIT = "osc"


def packet(delivery: Delivery) -> bytes:
    """A reading as a bundle, with a message for each quantity."""
    numbers = {n: v if isinstance(v, tuple) else (v,) for n, v in delivery.values.items()}
    said = (osc_message(f"/{delivery.device}/{name}", value) for name, value in numbers.items())
    return osc_bundle(delivery.clock_s, said)


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A packet for each reading."""
    framed = slip if emulated.place.transport == "serial" else bytes
    for delivery in emulated.deliveries():
        yield DeviceMessage(delivery.due_s, _UNIT, framed(packet(delivery)))


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a device of the one sender."""
    streams = {name: (_UNIT, name) for name in emulated.recording.names}
    return Wiring("osc", senders(emulated.place, "osc", [_UNIT]), streams)


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await carry(emulated, [_UNIT], messages(emulated))
