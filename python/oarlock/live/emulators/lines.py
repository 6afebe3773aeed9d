"""Emulates units that send JSON lines: what a club builds from a microcontroller and a sensor chip."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from collections.abc import Callable, Iterable, Iterator

from oarlock.live.emulators.carriers import carry, senders
from oarlock.live.emulators.deliveries import Delivery
from oarlock.live.emulators.emulated import DeviceMessage, Emulated, Wiring

_UNIT = "lines"
"""One sender passes on what all units measure; each line names its unit."""
_WRAP = 2**32


def json_line(delivery: Delivery) -> bytes:
    """A reading as a line of JSON, its clock in microseconds that wrap at 2^32."""
    told = {
        "device": delivery.device,
        "t_us": round(1e6 * delivery.clock_s) % _WRAP,
        "seq": delivery.count % _WRAP,
        **delivery.values,
    }
    return json.dumps(told, separators=(",", ":")).encode() + b"\n"


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


async def send(
    sent: Iterable[Delivery],
    host: str,
    port: int,
    encode: Callable[[Delivery], bytes] = json_line,
    speed: float = 1.0,
) -> int:
    """Sends each delivery as a datagram when it is due.

    Args:
        sent: in the order of arrival.
        host: who gets them.
        port: where.
        encode: a delivery as bytes.
        speed: 2 sends twice as fast as it was.

    Returns:
        How many were sent.
    """
    begun_s, count = None, 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for delivery in sent:
            # Making the first delivery may take a while, which is not the devices' delay.
            begun_s = time.monotonic() - delivery.due_s / speed if begun_s is None else begun_s
            while (early_s := begun_s + delivery.due_s / speed - time.monotonic()) > 0.0:
                await asyncio.sleep(early_s)
            sender.sendto(encode(delivery), (host, port))
            count += 1
    return count
