"""Packets to readings of the model's sensors, each with its time: decoding, clocks, and what a page says of a device.

An `Intake` looks at no clock of its own: the same packets give the same readings, live and from a recording of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from oarlock.live.clock import DeviceClock
from oarlock.live.reading import Decoder, Packet, Reading
from oarlock.live.rig import Feed, Rig, Source
from oarlock.recording.plausibility import GYRO_MAX_RAD_S

_MOST = {"gyro_rad_s": GYRO_MAX_RAD_S, "accel_m_s2": 2000.0, "mag_ut": 10_000.0, "value": 1000.0}
"""Beyond the ranges of sensors: 2000 m/s2 is 200 g, and at 10 mT a magnetometer has a magnet on it."""
MOST_SENDERS = 256
"""Addresses of a source that are known at once: programs that connect again and again have a new one each time."""
RATE_OVER_S = 2.0
"""Rates are counted over so much time."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """A reading of one of the model's sensors, ready for `Tracker.push`.

    Args:
        stream: name in the model.
        time_s: by this machine's clock, s from the session's start.
        values: a number, or name -> numbers of an inertial unit's quantities.
        arrival_s: when its packet was received, s from the session's start.
    """

    stream: str
    time_s: float
    values: float | Mapping[str, tuple[float, ...]] = field(hash=False)
    arrival_s: float


@dataclass
class Device:
    """One sender: its clock, and how it does.

    Args:
        source, address, part: where it was heard; together its key.
        streams: of the model that it feeds; empty for one that the rig does not use.
    """

    source: str
    address: str
    part: str
    streams: tuple[str, ...] = ()
    clock: DeviceClock = field(default_factory=DeviceClock)
    readings: int = 0
    lost: int = 0
    """Readings that its counter shows to be missing."""
    implausible: int = 0
    """Readings that no sensor can measure; they are left out."""
    last_arrival_s: float = -math.inf
    delay_s: float = 0.0
    """How much later than the fastest readings the last ones came, on average."""
    battery_percent: float | None = None
    is_settled: bool = False
    """Whether the time of its last reading is known."""
    _count: int | None = None
    _second: tuple[float, int] = (-math.inf, 0)
    _rate_hz: float = 0.0

    @property
    def name(self) -> str:
        """Its address, with the part if it has several."""
        return f"{self.address}/{self.part}" if self.address and self.part else self.address or self.part

    def rate_hz(self, now_s: float) -> float:
        """Readings a second of late; 0 for one that is silent."""
        return self._rate_hz if now_s - self.last_arrival_s < RATE_OVER_S else 0.0

    def hear(self, reading: Reading, arrival_s: float) -> float | None:
        """Counts a reading, and gives its time by this machine's clock; None while that is unknown."""
        self.readings += 1
        self._see_loss(reading.count)
        began_s, heard = self._second
        if arrival_s - began_s >= RATE_OVER_S:
            self._rate_hz = heard / (arrival_s - began_s) if math.isfinite(began_s) else 0.0
            self._second = (arrival_s, 0)
        self._second = (self._second[0], self._second[1] + 1)
        self.last_arrival_s = arrival_s
        battery = reading.values.get("battery_percent")
        if isinstance(battery, float | int):
            self.battery_percent = float(battery)
        if reading.clock_s is None:
            self.is_settled = True
            return arrival_s
        time_s = self.clock.time_s(reading.clock_s, arrival_s)
        self.is_settled = time_s is not None
        if time_s is not None:
            self.delay_s += 0.02 * (arrival_s - time_s - self.delay_s)
        return time_s

    def _see_loss(self, count: int | None) -> None:
        if count is None:
            return
        if self._count is not None and 1 < count - self._count < 100_000:
            self.lost += count - self._count - 1
        self._count = (
            count if self._count is None or count > self._count or self._count - count > 1000 else self._count
        )


@dataclass
class Intake:
    """Decodes packets and says which sensor of the model each reading is of.

    Args:
        rig: which device feeds which stream.
        start_ns: the session's start by the clock of arrivals; times count from there.
        decoders: makes a new decoder for a device of a source.
    """

    rig: Rig
    start_ns: int
    decoders: Callable[[Source], Decoder]
    devices: dict[tuple[str, str, str], Device] = field(default_factory=dict)
    _decoders: dict[tuple[str, str], Decoder] = field(default_factory=dict)
    _feeds: dict[str, Feed] = field(default_factory=dict)
    _newest_s: dict[str, float] = field(default_factory=dict)
    _heard_s: dict[tuple[str, str], float] = field(default_factory=dict)
    _damaged_before: dict[str, int] = field(default_factory=dict)
    """By source, of senders that are forgotten."""

    def __post_init__(self) -> None:
        self._feeds = {feed.stream: feed for feed in self.rig.feeds}

    def take(self, packet: Packet) -> list[Sampled]:
        """The readings of the model's sensors in a packet, with their times."""
        source = self.rig.sources.get(packet.source)
        if source is None:
            return []
        key = (packet.source, packet.address)
        if key not in self._decoders:
            self._make_room(packet.source)
            self._decoders[key] = self.decoders(source)
        arrival_s = self._heard_s[key] = self.seconds(packet.arrival_ns)
        found: list[Sampled] = []
        for reading in self._decoders[key].decode(packet.data, packet.channel):
            device = self._device(packet, reading.device)
            time_s = device.hear(reading, arrival_s)
            if time_s is not None:
                found += self._sampled(device, reading, time_s, arrival_s)
        return found

    def seconds(self, arrival_ns: int) -> float:
        """Seconds from the session's start."""
        return (arrival_ns - self.start_ns) / 1e9

    def assign(self, stream: str, device: str) -> None:
        """From now on another device feeds a stream: a unit was exchanged."""
        self._feeds[stream] = replace(self._feeds[stream], device=device)
        for one in self.devices.values():
            one.streams = self._streams(one)

    def damaged(self, source: str) -> int:
        """Messages of a source that could not be decoded."""
        now = sum(d.damaged for (name, _), d in self._decoders.items() if name == source)
        return now + self._damaged_before.get(source, 0)

    def silent(self, now_s: float, longer_s: float = 1.0) -> list[str]:
        """Streams from which nothing has come for so long, or ever."""
        heard = dict.fromkeys(self._feeds, -math.inf)
        for device in self.devices.values():
            for stream in device.streams:
                heard[stream] = max(heard[stream], device.last_arrival_s)
        return [stream for stream, last_s in heard.items() if now_s - last_s > longer_s]

    def heard(self) -> list[str]:
        """Streams of which anything has come."""
        return [stream for device in self.devices.values() for stream in device.streams]

    def _make_room(self, source: str) -> None:
        """Forgets the sender that has been silent for longest, if a new one would be too many."""
        known = [key for key in self._decoders if key[0] == source]
        if len(known) < MOST_SENDERS:
            return
        gone = min(known, key=self._heard_s.__getitem__)
        self._damaged_before[source] = self._damaged_before.get(source, 0) + self._decoders.pop(gone).damaged
        del self._heard_s[gone]
        for device in [device for device in self.devices if device[:2] == gone]:
            del self.devices[device]

    def _device(self, packet: Packet, part: str) -> Device:
        key = (packet.source, packet.address, part)
        if key not in self.devices:
            device = Device(*key)
            device.streams = self._streams(device)
            self.devices[key] = device
        return self.devices[key]

    def _streams(self, device: Device) -> tuple[str, ...]:
        return tuple(
            f.stream
            for f in self._feeds.values()
            if f.source == device.source and f.takes(device.address, device.part)
        )

    def _sampled(self, device: Device, reading: Reading, time_s: float, arrival_s: float) -> list[Sampled]:
        found = []
        for stream in device.streams:
            values = values_for(self._feeds[stream], reading)
            if values is not None and not is_plausible(values):
                device.implausible += 1
                continue
            # At an exchange two devices may feed the same stream, but not at the same time.
            if values is not None and time_s != self._newest_s.get(stream):
                self._newest_s[stream] = time_s
                found.append(Sampled(stream, time_s, values, arrival_s))
        return found


def is_plausible(values: float | Mapping[str, tuple[float, ...]]) -> bool:
    """Whether a sensor can measure this: damaged bytes may be numbers, too, and one of 1e6 rad/s costs the track."""
    if not isinstance(values, Mapping):
        return abs(values) <= _MOST["value"]
    return all(max(map(abs, numbers)) <= _MOST.get(name, math.inf) for name, numbers in values.items())


def values_for(feed: Feed, reading: Reading) -> float | Mapping[str, tuple[float, ...]] | None:
    """What `Tracker.push` takes of a reading; None if it holds nothing for this stream."""
    if feed.kind == "imu":
        found = {name: reading.values.get(name) for name in feed.values}
        return {name: v for name, v in found.items() if isinstance(v, tuple)} or None
    value = reading.values.get(feed.values[0])
    if value is None or isinstance(value, str):
        return None
    if isinstance(value, tuple):
        return {"quat_wxyz" if feed.kind == "orientation" else "value": value}
    return feed.scale * value + feed.offset
