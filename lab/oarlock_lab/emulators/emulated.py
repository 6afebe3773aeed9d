"""What an emulated device measures, what goes wrong on the way, and where it sends; all emulators take this."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from oarlock.live.simulated_devices import Delivery, Faults, deliveries, endless

if TYPE_CHECKING:
    from oarlock.recording.recording import Recording


@dataclass(frozen=True)
class Destination:
    """Where a device sends.

    Args:
        transport: "udp", "tcp", "serial", "ble", "lsl" or what else the kind has; "" for its usual one.
        host: to whom (UDP), or at which address of this machine (TCP).
        port: of the receiver (UDP), or at which the first unit serves (TCP); None for the kind's usual one. By UDP
            units send from the ports that follow it, so that a receiver can tell them apart.
        path: where the serial line of the first unit appears; None for `oarlock-line`.
        adapter: a Bluetooth adapter that the system does not use, as bumble names it, such as `usb:0`.
    """

    transport: str = ""
    host: str = "127.0.0.1"
    port: int | None = None
    path: Path | None = None
    adapter: str = ""


@dataclass(frozen=True)
class Emulated:
    """What a device is to emulate.

    Args:
        recording: what its sensors measure; devices without a body, such as a belt, look only at its times.
        period_s: after which the recording begins again; None to send it once.
        faults: on the way.
        seed: of all that is drawn.
        place: where to send.
        say: gets a line when something is open, such as the path of a serial line.
    """

    recording: Recording
    period_s: float | None = None
    faults: Faults = field(default_factory=Faults)
    seed: int = 0
    place: Destination = field(default_factory=Destination)
    say: Callable[[str], None] = lambda text: None

    def of(self, *kinds: str) -> Emulated:
        """The same with only the streams of these kinds ("imu", "scalar", "vector", "orientation")."""
        from oarlock.recording.recording import Recording

        streams = [stream for stream in self.recording.streams if stream.kind in kinds]
        return replace(self, recording=Recording(streams))

    def deliveries(self, *, is_one_device: bool = False) -> Iterator[Delivery]:
        """The readings as they are sent, in this order.

        Args:
            is_one_device: all streams have one clock and one way, and are sent together.
        """
        if self.period_s is None:
            return iter(deliveries(self.recording, self.faults, self.seed, is_one_device=is_one_device))
        return endless(self.recording, self.period_s, self.faults, self.seed, is_one_device=is_one_device)


@dataclass(frozen=True, slots=True)
class DeviceMessage:
    """Bytes that a device sends at once.

    Args:
        due_s: when they arrive, s from the start.
        unit: which of the devices.
        data: the bytes.
        channel: the part of the device, as in `Packet`.
    """

    due_s: float
    unit: str
    data: bytes
    channel: str = ""


@dataclass(frozen=True)
class UnitAddress:
    """How a receiver finds one unit: a source of its rig file, and the address from which packets come.

    Args:
        source: name of the source; units may share one.
        transport: of the source.
        options: of the transport.
        address: as the transport tells it.
    """

    source: str
    transport: str
    options: dict[str, object]
    address: str


@dataclass(frozen=True)
class Wiring:
    """How the streams of an emulated recording reach a receiver.

    Args:
        format: name of the decoder.
        senders: by unit.
        streams: stream -> unit, and the part of it as readings name it ("" if it has only one).
        decoder: options of the decoder.
        values: quantities that the wire carries of an inertial unit.
    """

    format: str
    senders: dict[str, UnitAddress]
    streams: dict[str, tuple[str, str]]
    decoder: dict[str, object] = field(default_factory=dict)
    values: tuple[str, ...] = ("gyro_rad_s", "accel_m_s2", "mag_ut")

    def device(self, stream: str) -> str:
        """The device of a stream as a rig file names it."""
        unit, part = self.streams[stream]
        own = self.senders[unit]
        is_alone = sum(other.source == own.source for other in self.senders.values()) == 1
        return part if is_alone else "/".join(name for name in (own.address, part) if name)


def frames(emulated: Emulated) -> Iterator[list[Delivery]]:
    """The readings of one system, those with the same stamp together."""
    for _, together in groupby(emulated.deliveries(is_one_device=True), lambda one: (one.due_s, one.clock_s)):
        yield list(together)


T = TypeVar("T")


def on_the_way(emulated: Emulated, moments: Iterable[tuple[float, T]]) -> Iterator[tuple[float, float, T]]:
    """Arrival (s from the start), time, and what is sent then, of each message that arrives.

    Args:
        emulated: faults, seed, and when it ends: with the recording, if that does not begin again.
        moments: time and what is sent, in order; without end.
    """
    faults, rng, last_s = emulated.faults, np.random.default_rng(emulated.seed), 0.0
    ends_s = np.inf if emulated.period_s is not None else emulated.recording.end_s
    waiting: list[tuple[float, T]] = []
    for time_s, sent in moments:
        if time_s > ends_s:
            return
        waiting.append((time_s, sent))
        if len(waiting) < faults.burst:
            continue
        last_s = max(last_s, time_s + 1e-3 * (faults.least_ms + rng.exponential(faults.jitter_ms)))
        for one in waiting:
            if rng.random() >= faults.loss:
                yield last_s, *one
        waiting.clear()
