"""Emulates units that send JSON lines: what a club builds from a microcontroller and a sensor chip."""

from __future__ import annotations

from collections.abc import Iterator

from oarlock.live.simulated_devices import json_line
from oarlock_lab.emulators.carriers import carry, senders
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, Wiring

_UNIT = "lines"
"""One sender passes on what all units measure; each line names its unit."""


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """A line for each reading."""
    for delivery in emulated.deliveries():
        yield DeviceMessage(delivery.due_s, _UNIT, json_line(delivery))


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a device of the one sender."""
    streams = {name: (_UNIT, name) for name in emulated.recording.names}
    return Wiring("lines", senders(emulated.place, "lines", [_UNIT]), streams)


async def emulate(emulated: Emulated) -> None:
    """Send lines until the movement ends, or it is cancelled."""
    await carry(emulated, [_UNIT], messages(emulated))
