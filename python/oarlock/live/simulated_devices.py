"""Simulated devices: when each sends which reading, as lines of JSON, and the rig that receives them.

The demonstration of `oarlock live`, the emulators of oarlock-lab and tests use them.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools
import json
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from oarlock._core import Model
from oarlock.live.rig import Feed, Rig, Source, streams_of
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock.recording.streams import Stream

LINES = "lines"
_WRAP = 2**32


@dataclass(frozen=True)
class Faults:
    """What goes wrong between the sensors and this machine; the defaults are a quiet room.

    Args:
        drift_ppm: clocks of devices run too fast or too slow by as much, by chance.
        least_ms: least time on the way.
        jitter_ms: mean of what is added to it, exponential.
        burst: so many readings are sent together.
        loss: share of packets that do not arrive.
        dropouts: (device, from s, to s) in which it sends nothing.
        magnet: (device, from s, to s, uT along its first axis).
    """

    drift_ppm: float = 0.0
    least_ms: float = 1.0
    jitter_ms: float = 1.0
    burst: int = 1
    loss: float = 0.0
    dropouts: tuple[tuple[str, float, float], ...] = ()
    magnet: tuple[tuple[str, float, float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Delivery:
    """One reading that is sent.

    Args:
        due_s: when it arrives, s from the start.
        device: its name.
        clock_s: the device's stamp.
        count: the device's counter.
        values: quantity -> numbers, as a `Reading` names them.
    """

    due_s: float
    device: str
    clock_s: float
    count: int
    values: Mapping[str, float | tuple[float, ...]] = field(hash=False)


def deliveries(
    recording: Recording, faults: Faults, seed: int = 0, *, is_one_device: bool = False
) -> list[Delivery]:
    """All readings of a recording as its devices send them, in the order of arrival.

    Args:
        recording: a stream is a device.
        faults: on the way.
        seed: of all that is drawn.
        is_one_device: one device has all streams, so that they share its clock and its way.
    """
    return list(_round(recording, faults, seed, 0, 0.0, is_one_device))


def endless(
    recording: Recording, period_s: float, faults: Faults, seed: int = 0, *, is_one_device: bool = False
) -> Iterator[Delivery]:
    """A recording of a movement that repeats itself, again and again, while clocks and counters run on.

    Args:
        recording: from 0 to before `period_s`; its end joins its start.
        period_s: after which it begins again.
        faults: on the way; their times count from the first start.
        seed: of all that is drawn.
        is_one_device: as for `deliveries`.
    """
    for number in itertools.count():
        yield from _round(recording, faults, seed, number, period_s, is_one_device)


def _round(
    recording: Recording, faults: Faults, seed: int, number: int, period_s: float, is_one_device: bool
) -> Iterator[Delivery]:
    # One by one: a sender that made a whole round at once would be late with the readings of that time.
    streams = [
        _of(stream, faults, (seed, 0 if is_one_device else device), number, number * period_s)
        for device, stream in enumerate(recording.streams)
    ]
    return heapq.merge(*streams, key=lambda delivery: (delivery.due_s, delivery.clock_s))


def _of(
    stream: Stream, faults: Faults, seed: tuple[int, int], number: int, late_s: float
) -> Iterator[Delivery]:
    own, rng = np.random.default_rng(seed), np.random.default_rng((*seed, number))
    zero_s, drift = own.uniform(0.0, 1000.0), 1e-6 * faults.drift_ppm * own.choice([-1.0, 1.0])
    time_s, first = stream.time_s + late_s, number * len(stream.time_s)
    ready_s = _together(time_s, faults.burst)
    queue_s = 1e-3 * (faults.least_ms + rng.exponential(faults.jitter_ms, len(time_s)))
    # A radio keeps the order of one device; a burst shares its time on the way.
    due_s = np.maximum.accumulate(ready_s + _together(queue_s, faults.burst))
    sent = rng.random(len(time_s)) >= faults.loss
    for device, from_s, to_s in faults.dropouts:
        sent &= (stream.name != device) | (time_s < from_s) | (time_s >= to_s)
    clock_s = zero_s + (1.0 + drift) * time_s
    for row in np.flatnonzero(sent):
        values = _values(stream, int(row), float(time_s[row]), faults)
        if values:
            yield Delivery(float(due_s[row]), stream.name, float(clock_s[row]), first + int(row), values)


def _together(values: Floats, burst: int) -> Floats:
    """Each group of so many rows has the last one's value."""
    last = np.minimum((np.arange(len(values)) // burst + 1) * burst, len(values)) - 1
    found: Floats = values[last]
    return found


def _values(stream: Stream, row: int, time_s: float, faults: Faults) -> dict[str, float | tuple[float, ...]]:
    found: dict[str, float | tuple[float, ...]] = {}
    for name, rows in stream.values.items():
        name, value = "position_m" if stream.kind == "vector" else name, rows[row]
        if np.isfinite(value).all():
            found[name] = float(value) if np.ndim(value) == 0 else tuple(float(x) for x in value)
    field_ut = found.get("mag_ut")
    if isinstance(field_ut, tuple):
        for device, from_s, to_s, added_ut in faults.magnet:
            if stream.name == device and from_s <= time_s < to_s:
                found["mag_ut"] = (field_ut[0] + added_ut, *field_ut[1:])
    return found


def at_zero(recording: Recording, from_s: float, period_s: float) -> Recording:
    """One period of a recording, whose times then count from 0."""
    cut = recording.slice(start_s=from_s, end_s=from_s + period_s)
    return Recording([stream.at_rows(slice(None), stream.time_s - from_s) for stream in cut.streams])


def json_line(delivery: Delivery) -> bytes:
    """A reading as a line of JSON, its clock in microseconds that wrap at 2^32."""
    told = {
        "device": delivery.device,
        "t_us": round(1e6 * delivery.clock_s) % _WRAP,
        "seq": delivery.count % _WRAP,
        **delivery.values,
    }
    return json.dumps(told, separators=(",", ":")).encode() + b"\n"


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


def lines_rig(model: Model, name: str, port: int, rate_hz: float, streams: tuple[str, ...] = ()) -> Rig:
    """A rig whose devices have the names of the streams that they feed.

    Args:
        model: of the body.
        name: of the model, as a rig file has it.
        port: of this machine, to which the devices send.
        rate_hz: of all.
        streams: those that have a device; all of the model's if empty.
    """
    feeds = tuple(
        Feed(stream, kind, LINES, stream, values, rate_hz)
        for stream, (kind, values) in streams_of(model).items()
        if not streams or stream in streams
    )
    source = Source(LINES, LINES, "udp", {"port": port, "host": "127.0.0.1"})
    return Rig(name, None, {LINES: source}, feeds)
