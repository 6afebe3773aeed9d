"""Packets to readings of the model's sensors, each with its time: decoding, clocks, and what a page says of a device.

An `Intake` looks at no clock of its own: the same packets give the same readings, live and from a recording of them.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from oarlock.live.clock import DeviceClock
from oarlock.live.counting import RATE_STD, Counting
from oarlock.live.envelope import Envelope
from oarlock.live.fresh import Fresh
from oarlock.live.mag_units import MagUnit
from oarlock.live.reading import Decoder, Packet, Reading, Value
from oarlock.live.rig import Feed, Rig, Source
from oarlock.recording.plausibility import GYRO_MAX_RAD_S
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

KEEPS_S = 1.0
"""A device that was heard keeps its streams for so long; another one that sends as them is refused."""
KNOWN_READINGS = 10
"""Of a device that can keep a stream: some senders have another address for each packet."""
_MOST = {"gyro_rad_s": GYRO_MAX_RAD_S, "accel_m_s2": 2000.0, "mag_ut": 10_000.0, "value": 1000.0}
"""Beyond the ranges of sensors: 2000 m/s2 is 200 g, and at 10 mT a magnetometer has a magnet on it."""
MOST_SENDERS = 256
"""Addresses of a source that are known at once: programs that connect again and again have a new one each time."""
RATE_OVER_S = 2.0
"""Rates are counted over so much time."""
MOST_SHOWN = 50
"""So many quantities of a device are shown, whatever it sends."""
LATELY_S = 1.0
ARRIVAL_STD_S = defaultdict(
    lambda: 5e-3, {"serial": 2e-3, "ble": 12e-3, "udp": 5e-3, "tcp": 5e-3, "mqtt": 1e-2, "websocket": 1e-2}
)
"""Standard deviation of the time on the way, by transport: the interval of a Bluetooth connection, queues of Wi-Fi."""
TIE_SLEW = 5e-3
"""Ties move by 5 ms a second: a usual one is reached in a few seconds, and a movement does not show it."""


Heard = tuple[Reading, float]
"""A reading, and when its packet was received, s from the session's start."""


@dataclass(frozen=True, slots=True)
class SensorReading:
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


@dataclass(frozen=True, slots=True)
class Spare:
    """What no sensor of the model takes of a reading, such as heart rate.

    Args:
        channel: name of the source, and the part of the device behind a "/".
        address: of the device.
        time_s: by this machine's clock, s from the session's start.
        arrival_s: when its packet was received, s from the session's start.
        clock_s: the device's own stamp; None without.
        values: quantity -> number, numbers or text.
    """

    channel: str
    address: str
    time_s: float
    arrival_s: float
    clock_s: float | None
    values: Mapping[str, Value] = field(hash=False)


@dataclass
class Tie:
    """What is taken off a device's times because the movement shows that they are late; slewed, never stepped.

    Args:
        late_s: s.
        std_s: its standard deviation, s; NaN while nothing is known.
    """

    late_s: float = 0.0
    std_s: float = math.nan
    _used_s: float = 0.0
    _at_s: float = 0.0

    def used_s(self, arrival_s: float) -> float:
        """What is taken off now, s."""
        room_s = TIE_SLEW * max(arrival_s - self._at_s, 0.0)
        self._used_s += min(max(self.late_s - self._used_s, -room_s), room_s)
        self._at_s = max(arrival_s, self._at_s)
        return self._used_s


@dataclass
class DeviceState:
    """One sender: its clock, and how it does.

    Args:
        source, address, part: where it was heard; together its key.
        streams: of the model that it feeds; empty for one that the rig does not use.
        taken: names of the values that these take.
    """

    source: str
    address: str
    part: str
    streams: tuple[str, ...] = ()
    taken: frozenset[str] = frozenset()
    newest: dict[str, Value] = field(default_factory=dict)
    """The last of each value that no stream takes."""
    clock: DeviceClock[Heard] = field(default_factory=DeviceClock)
    tie: Tie = field(default_factory=Tie)
    counting: Counting | None = None
    """Makes a clock of its counter, if its rate is known."""
    readings: int = 0
    lost: int = 0
    """Readings that its counter shows to be missing."""
    refused: int = 0
    """Readings that are not used, because another device of this name speaks."""
    implausible: int = 0
    """Readings that no sensor can measure; they are left out."""
    last_arrival_s: float = -math.inf
    delay_s: float = 0.0
    """How much later than the fastest readings the last ones came, on average."""
    battery_percent: float | None = None
    is_stamped: bool = False
    """Whether its readings have stamps of its own clock, or counts that serve as one."""
    _count: int | None = None
    _second: tuple[float, int] = (-math.inf, 0)
    _rate_hz: float = 0.0

    @property
    def name(self) -> str:
        """Its address, with the part if it has several."""
        return f"{self.address}/{self.part}" if self.address and self.part else self.address or self.part

    @property
    def channel(self) -> str:
        """Name of the channel of what feeds no sensor."""
        return f"{self.source}/{self.part}" if self.part else self.source

    def spare(self, reading: Reading) -> dict[str, Value]:
        """What no stream takes of a reading."""
        return {name: value for name, value in reading.values.items() if name not in self.taken}

    def rate_hz(self, now_s: float) -> float:
        """Readings a second of late; 0 for one that is silent."""
        return self._rate_hz if now_s - self.last_arrival_s < RATE_OVER_S else 0.0

    @property
    def is_settled(self) -> bool:
        """Whether times of its readings are known at once."""
        return self.readings > 0 and (not self.is_stamped or self.clock.offset_s is not None)

    @property
    def sender(self) -> tuple[str, str]:
        """What its parts have in common."""
        return self.source, self.address

    def hear(self, reading: Reading, arrival_s: float) -> list[tuple[Heard, float]]:
        """Counts a reading, and gives those whose times by this machine's clock are known now."""
        self.readings += 1
        self._see_loss(reading.count)
        began_s, heard = self._second
        if arrival_s - began_s >= RATE_OVER_S:
            self._rate_hz = heard / (arrival_s - began_s) if math.isfinite(began_s) else 0.0
            self._second = (arrival_s, 0)
        self._second = (self._second[0], self._second[1] + 1)
        self.last_arrival_s = arrival_s
        for name, value in self.spare(reading).items():
            if name in self.newest or len(self.newest) < MOST_SHOWN:
                self.newest[name] = value
        battery = reading.values.get("battery_percent")
        if isinstance(battery, float | int):
            self.battery_percent = float(battery)
        clock_s = (
            reading.clock_s if reading.clock_s is not None else self._counted_s(reading.count, arrival_s)
        )
        if clock_s is None:
            return [((reading, arrival_s), arrival_s)]
        self.is_stamped = True
        timed = self.clock.take(clock_s, arrival_s, (reading, arrival_s))
        for _, time_s in timed[-1:]:
            self.delay_s += 0.02 * (arrival_s - time_s - self.delay_s)
        return timed

    def _counted_s(self, count: int | None, arrival_s: float) -> float | None:
        if self.counting is None or count is None:
            return None
        clock_s = self.counting.clock_s(count, arrival_s)
        if clock_s is not None and not self.is_stamped:
            self.clock.envelope = Envelope(RATE_STD)
        return clock_s

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
        keep: gets what no sensor takes.
    """

    rig: Rig
    start_ns: int
    decoders: Callable[[Source], Decoder]
    keep: Callable[[Spare], None] = lambda spare: None
    on_timed: Callable[[SensorReading], None] = lambda one: None
    """Gets each reading with the time of its device's clock, before a tie is taken off."""
    devices: dict[tuple[str, str, str], DeviceState] = field(default_factory=dict)
    _decoders: dict[tuple[str, str], Decoder] = field(default_factory=dict)
    _feeds: dict[str, Feed] = field(default_factory=dict)
    mag_units: dict[str, MagUnit] = field(default_factory=dict)
    """Of the streams with a magnetometer."""
    _fresh: dict[str, Fresh] = field(default_factory=dict)
    _feeders: dict[str, DeviceState] = field(default_factory=dict)
    """Which device feeds each stream."""
    _newest_s: dict[str, float] = field(default_factory=dict)
    _heard_s: dict[tuple[str, str], float] = field(default_factory=dict)
    _damaged_before: dict[str, int] = field(default_factory=dict)
    """By source, of senders that are forgotten."""

    def __post_init__(self) -> None:
        self._feeds = {feed.stream: feed for feed in self.rig.feeds}
        self._fresh = {feed.stream: Fresh(feed.kind == "imu") for feed in self.rig.feeds}
        self.mag_units = {
            feed.stream: MagUnit(feed.mag_unit_ut) for feed in self.rig.feeds if "mag_ut" in feed.values
        }

    def take(self, packet: Packet) -> list[SensorReading]:
        """The readings of the model's sensors in a packet, with their times."""
        source = self.rig.sources.get(packet.source)
        if source is None:
            return []
        key = (packet.source, packet.address)
        if key not in self._decoders:
            self._make_room(packet.source)
            self._decoders[key] = self.decoders(source)
        arrival_s = self._heard_s[key] = self.seconds(packet.arrival_ns)
        found: list[SensorReading] = []
        for reading in self._decoders[key].decode(packet.data, packet.channel):
            device = self._device(packet, reading.device)
            if self._is_second(device, arrival_s):
                device.refused += 1
                continue
            self._notice(device, reading, arrival_s)
            for heard, time_s in device.hear(reading, arrival_s):
                found += self._taken(device, heard, time_s)
        return found

    def flush(self) -> list[SensorReading]:
        """The readings that clocks hold back, as they are timed by what is known now."""
        return [
            one
            for device in self.devices.values()
            for heard, time_s in device.clock.flush()
            for one in self._taken(device, heard, time_s)
        ]

    def seconds(self, arrival_ns: int) -> float:
        """Seconds from the session's start."""
        return (arrival_ns - self.start_ns) / 1e9

    def assign(self, stream: str, device: str) -> None:
        """From now on another device feeds a stream: a unit was exchanged.

        Raises:
            DataError: the rig has no such stream.
        """
        if stream not in self._feeds:
            raise DataError(
                f"the rig has no stream '{stream[:40]}'. {did_you_mean(stream, sorted(self._feeds))}"
            )
        self._feeds[stream] = replace(self._feeds[stream], device=device)
        for one in self.devices.values():
            self._connect(one)

    def tie(self, stream: str, late_s: float, std_s: float) -> None:
        """From now on the times of the device that feeds a stream are this much less."""
        device = self.feeding().get(stream)
        if device is not None:
            device.tie.late_s, device.tie.std_s = late_s, std_s

    def feeding(self) -> dict[str, DeviceState]:
        """The device that fed each stream last."""
        by_arrival = sorted(self.devices.values(), key=lambda device: device.last_arrival_s)
        return {stream: device for device in by_arrival for stream in device.streams}

    def damaged(self, source: str) -> int:
        """Messages of a source that could not be decoded."""
        now = sum(d.damaged for (name, _), d in self._decoders.items() if name == source)
        return now + self._damaged_before.get(source, 0)

    def silent(self, now_s: float, longer_s: float = 1.0) -> list[str]:
        """Streams of which nothing of use has come for so long, or for three readings of a slow one; or ever."""
        return [
            stream
            for stream, fresh in self._fresh.items()
            if now_s - fresh.usable_s > max(longer_s, 3.0 / (self._feeds[stream].rate_hz or math.inf))
        ]

    def stuck(self) -> list[str]:
        """Streams that repeat one reading; they are not used until it changes."""
        return [stream for stream, fresh in self._fresh.items() if fresh.is_stuck]

    def heard(self) -> list[str]:
        """Streams of which anything of use has come."""
        return [stream for stream, fresh in self._fresh.items() if math.isfinite(fresh.usable_s)]

    def stamp_stds(self) -> dict[str, float]:
        """Standard deviation of the time stamps of streams whose time is that of their arrival, s."""
        feeding = self.feeding()
        found = {}
        for stream, feed in self._feeds.items():
            device = feeding.get(stream)
            if feed.stamp_std_s is not None:
                found[stream] = feed.stamp_std_s
            elif device is not None and not device.is_stamped:
                found[stream] = ARRIVAL_STD_S[self.rig.sources[feed.source].transport]
        return found

    def _is_second(self, device: DeviceState, arrival_s: float) -> bool:
        """Whether another device that was heard just now feeds a stream of this one; else this one feeds them."""
        for stream in device.streams:
            first = self._feeders.get(stream, device)
            is_known = first.readings >= KNOWN_READINGS and stream in first.streams
            if first is not device and is_known and arrival_s - first.last_arrival_s < KEEPS_S:
                return True
        self._feeders.update(dict.fromkeys(device.streams, device))
        return False

    def _notice(self, device: DeviceState, reading: Reading, arrival_s: float) -> None:
        for stream in device.streams:
            values = values_for(self._feeds[stream], reading)
            if values is not None:
                self._fresh[stream].see(values, arrival_s)

    def _make_room(self, source: str) -> None:
        """Forgets the sender that has been silent for longest, if a new one would be too many."""
        known = [key for key in self._decoders if key[0] == source]
        if len(known) < MOST_SENDERS:
            return
        gone = min(known, key=self._heard_s.__getitem__)
        self._damaged_before[source] = self._damaged_before.get(source, 0) + self._decoders.pop(gone).damaged
        del self._heard_s[gone]
        self.devices = {key: device for key, device in self.devices.items() if device.sender != gone}
        self._feeders = {s: device for s, device in self._feeders.items() if device.sender != gone}

    def _device(self, packet: Packet, part: str) -> DeviceState:
        key = (packet.source, packet.address, part)
        if key not in self.devices:
            device = DeviceState(*key)
            device.clock.are_others_late = partial(self._are_others_late, device)
            self._connect(device)
            device.counting = self._counting(device)
            self.devices[key] = device
        return self.devices[key]

    def _counting(self, device: DeviceState) -> Counting | None:
        rates = {self._feeds[stream].rate_hz for stream in device.streams} - {None}
        return Counting(rate) if len(rates) == 1 and (rate := rates.pop()) else None

    def _are_others_late(self, device: DeviceState) -> bool:
        """Whether all other senders with clocks that were heard lately are late."""
        others = [
            other.clock.is_late
            for other in self.devices.values()
            if other.sender != device.sender
            and other.is_stamped
            and other.last_arrival_s > device.last_arrival_s - LATELY_S
        ]
        return bool(others) and all(others)

    def _connect(self, device: DeviceState) -> None:
        """Says which streams a device feeds, and with which of its values."""
        feeds = [
            f
            for f in self._feeds.values()
            if f.source == device.source and f.takes(device.address, device.part)
        ]
        device.streams = tuple(f.stream for f in feeds)
        device.taken = frozenset(name for f in feeds for name in f.values)
        device.newest = {n: v for n, v in device.newest.items() if n not in device.taken}

    def _taken(self, device: DeviceState, heard: Heard, time_s: float) -> list[SensorReading]:
        reading, arrival_s = heard
        if spare := device.spare(reading):
            self.keep(Spare(device.channel, device.address, time_s, arrival_s, reading.clock_s, spare))
        return self._sampled(device, reading, time_s, arrival_s)

    def _sampled(
        self, device: DeviceState, reading: Reading, time_s: float, arrival_s: float
    ) -> list[SensorReading]:
        found = []
        for stream in device.streams:
            values = values_for(self._feeds[stream], reading, self.mag_units.get(stream))
            if values is not None and not is_plausible(values):
                device.implausible += 1
                continue
            if self._fresh[stream].is_stuck:
                continue
            if values is not None and time_s != self._newest_s.get(stream):
                self._newest_s[stream] = time_s
                one = SensorReading(stream, time_s, values, arrival_s)
                self.on_timed(one)
                late_s = device.tie.used_s(arrival_s)
                found.append(replace(one, time_s=time_s - late_s) if late_s else one)
        return found


def is_plausible(values: float | Mapping[str, tuple[float, ...]]) -> bool:
    """Whether a sensor can measure this: damaged bytes may be numbers, too, and one of 1e6 rad/s costs the track."""
    if not isinstance(values, Mapping):
        return abs(values) <= _MOST["value"]
    return all(max(map(abs, numbers)) <= _MOST.get(name, math.inf) for name, numbers in values.items())


def values_for(
    feed: Feed, reading: Reading, unit: MagUnit | None = None
) -> float | Mapping[str, tuple[float, ...]] | None:
    """What `Tracker.push` takes of a reading; None if it holds nothing for this stream.

    Args:
        feed: of the stream.
        reading: of its device.
        unit: of a magnetometer in arbitrary units.
    """
    if feed.kind == "imu":
        found = {name: reading.values.get(name) for name in feed.values}
        if unit is not None and found["mag_ut"] is None:
            found["mag_ut"] = unit.field_ut(reading.values.get("mag_arbitrary"))
        return {name: v for name, v in found.items() if isinstance(v, tuple)} or None
    value = reading.values.get(feed.values[0])
    if value is None or isinstance(value, str):
        return None
    if isinstance(value, tuple):
        return {"quat_wxyz" if feed.kind == "orientation" else "value": value}
    return feed.scale * value + feed.offset
