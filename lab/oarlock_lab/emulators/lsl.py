"""Emulates units that a program passes on to the Lab Streaming Layer: an outlet for each stream, by pylsl.

LSL has no standard for inertial channels; labels and units are those that most outlets of inertial units have. Numbers
are float32, stamps those of the sender's clock.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator, Sequence
from importlib import import_module
from struct import pack
from typing import Any, cast
from xml.sax.saxutils import escape

import numpy as np

from oarlock.live.decoders.lsl import HEADER, SAMPLES
from oarlock.live.simulated_devices import Delivery
from oarlock.recording.streams import Stream
from oarlock.storage.errors import DataError
from oarlock_lab.emulators.carriers import paced
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated, UnitAddress, Wiring

_GRAVITY_M_S2 = 9.80665
# Quantity -> label, unit and what one of it is in the unit of the stream.
_TRIPLES = {
    "accel_m_s2": ("Acc", "g", 1.0 / _GRAVITY_M_S2),
    "gyro_rad_s": ("Gyr", "deg/s", 180.0 / math.pi),
    "mag_ut": ("Mag", "uT", 1.0),
}
_SCALAR = "value"
_LISTENS_S = 0.05


def source_id(stream: str) -> str:
    """By which an outlet is found, also after a restart."""
    return f"oarlock-{stream}"


def labels(stream: Stream) -> list[tuple[str, str]]:
    """Label and unit of each channel."""
    if stream.kind == "scalar":
        return [(_SCALAR, "")]
    return [
        (head + axis, unit)
        for name, (head, unit, _) in _TRIPLES.items()
        if name in stream.values
        for axis in "XYZ"
    ]


def header(stream: Stream) -> bytes:
    """What an outlet says of itself, as a receiver gets it."""
    channels = "".join(
        f"<channel><label>{label}</label><unit>{unit}</unit></channel>" for label, unit in labels(stream)
    )
    return (
        f"<info><name>{escape(stream.name)}</name><channel_count>{len(labels(stream))}</channel_count>"
        f"<desc><channels>{channels}</channels></desc></info>"
    ).encode()


def sample(stream: Stream, delivery: Delivery) -> list[float]:
    """A row of the outlet: float32; NaN for a quantity that is missing."""
    if stream.kind == "scalar":
        row = [cast("float", delivery.values[_SCALAR])]
    else:
        row = [
            scale * one
            for name, (_, _, scale) in _TRIPLES.items()
            if name in stream.values
            for one in cast("Sequence[float]", delivery.values.get(name, (math.nan,) * 3))
        ]
    return [float(one) for one in np.array(row, dtype=np.float32)]


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """Headers and samples as the transport of a receiver packs them."""
    streams = {stream.name: stream for stream in emulated.recording.streams}
    for name, stream in streams.items():
        yield DeviceMessage(0.0, name, header(stream), HEADER)
    for delivery in emulated.deliveries():
        row = sample(streams[delivery.device], delivery)
        packed = pack(f"<{1 + len(row)}d", delivery.clock_s, *row)
        yield DeviceMessage(delivery.due_s, delivery.device, packed, SAMPLES)


def wiring(emulated: Emulated) -> Wiring:
    """Each stream is a source of its own."""
    names = emulated.recording.names
    senders = {
        name: UnitAddress(f"lsl_{k}", "lsl", {"source_id": source_id(name)}, source_id(name))
        for k, name in enumerate(names, 1)
    }
    return Wiring("lsl", senders, {name: (name, "") for name in names})


async def emulate(emulated: Emulated) -> None:
    """Open the outlets, and push samples from when all have listeners until the movement ends, or it is cancelled."""
    lsl = _pylsl()
    streams = {stream.name: stream for stream in emulated.recording.streams}
    outlets = {name: _outlet(lsl, stream) for name, stream in streams.items()}
    for name in outlets:
        emulated.say(f"is the stream with source_id {source_id(name)}")
    while not all(outlet.have_consumers() for outlet in outlets.values()):
        await asyncio.sleep(_LISTENS_S)
    async for delivery in paced(emulated.deliveries()):
        outlets[delivery.device].push_sample(sample(streams[delivery.device], delivery), delivery.clock_s)


def _outlet(lsl: Any, stream: Stream) -> Any:
    told = labels(stream)
    rate_hz, kind = round(stream.rate_hz, 3), "IMU" if stream.kind == "imu" else "Encoder"
    info = lsl.StreamInfo(stream.name, kind, len(told), rate_hz, "float32", source_id(stream.name))
    channels = info.desc().append_child("channels")
    for label, unit in told:
        one = channels.append_child("channel")
        one.append_child_value("label", label).append_child_value("unit", unit)
    return lsl.StreamOutlet(info)


def _pylsl() -> Any:
    try:
        return import_module("pylsl")
    except (ImportError, RuntimeError) as error:
        raise DataError(f"LSL needs pylsl with its library: pip install 'oarlock[lsl]' ({error})") from error
