"""Emulates sensors that somebody built and that send Open Sound Control, address DEVICE/QUANTITY."""

from __future__ import annotations

from collections.abc import Iterator

from oarlock.live.emulators.carriers import carry, senders
from oarlock.live.emulators.deliveries import Delivery
from oarlock.live.emulators.emulated import DeviceMessage, Emulated, Wiring
from oarlock.live.emulators.osc_packets import osc_bundle, osc_message, slip

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
