"""What a source delivers: packets as they were received, and the readings that a decoder makes of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

Value = float | tuple[float, ...] | str
RETAINED = "retained"
"""Channel of a packet that a broker kept for new listeners: nobody knows when it was sent."""


@dataclass(frozen=True, slots=True)
class Packet:
    """Bytes as a transport received them: a datagram, a notification, or what a line delivered at once.

    Args:
        source: the source's name in the rig file.
        address: of the device that sent it, as the transport knows it; "" if it cannot tell.
        channel: the part of the device, such as the UUID of a Bluetooth characteristic; "" if there is only one.
        arrival_ns: when it was received, by this machine's monotonic clock, ns.
        data: the bytes.
    """

    source: str
    address: str
    channel: str
    arrival_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Reading:
    """One message of a device, decoded: nothing is estimated, filled in or resampled.

    Args:
        device: the part of the sender that it comes from, such as a channel or a segment; "" if there is only one.
        clock_s: the device's own time, unwrapped, s from an arbitrary zero; None if it sends none.
        values: quantity -> numbers, or a text. Names carry the unit: `gyro_rad_s`, `accel_m_s2`, `mag_ut` (or
            `mag_arbitrary`), `quat_wxyz` (world from sensor), `battery_percent`, `speed_m_s`, `power_w`.
        count: the device's counter of messages, unwrapped; None if it sends none.
    """

    device: str
    clock_s: float | None
    values: Mapping[str, Value] = field(hash=False)
    count: int | None = None


class Decoder(Protocol):
    """Bytes of one device to readings. It keeps what a message needs of the ones before: a rest, unwrapped clocks.

    A decoder never raises on bytes: what is no message of its format is left out and counted, and the next message
    after it is decoded.
    """

    damaged: int
    """Messages, or stretches of bytes, that could not be decoded."""

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings that these bytes complete, in the order of their messages."""
