"""What packets of a rig's sources hold for each of its streams, and which devices sent them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from oarlock.live.decoders import DECODERS
from oarlock.live.intake import values_for
from oarlock.live.reading import Decoder, Packet, Reading
from oarlock.live.rig import Feed, Rig
from oarlock.live.scan.listening import Hearing
from oarlock.live.scan.recognition import Tally


@dataclass
class DeviceArrivals:
    """One device of a source.

    Args:
        source, address, part: where it was heard.
        streams: of the rig that it feeds.
        tally: of what it sent.
    """

    source: str
    address: str
    part: str
    streams: tuple[str, ...]
    tally: Tally = field(default_factory=Tally)

    @property
    def name(self) -> str:
        """As a rig file's `device` has it."""
        return self.part or self.address


@dataclass
class StreamHeard:
    """What came for one stream.

    Args:
        feed: of the rig.
        senders: keys of the devices that it came from.
        tally: of the readings that it can use.
        delays_s: arrival minus the device's clock.
        values: the last ones.
    """

    feed: Feed
    senders: set[str] = field(default_factory=set)
    tally: Tally = field(default_factory=Tally)
    delays_s: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def take(self, sender: DeviceArrivals, reading: Reading, arrival_s: float) -> None:
        """Count a reading, if it has something for this stream."""
        value = values_for(self.feed, reading)
        if value is None:
            return
        self.senders.add(f"{sender.source} {sender.address} {sender.part}")
        self.tally.add(reading, arrival_s)
        if reading.clock_s is not None:
            self.delays_s.append(arrival_s - reading.clock_s)
        if isinstance(value, float | int):
            self.values.append(float(value))
        elif (accel := value.get("accel_m_s2")) is not None:
            self.values.append(float(np.linalg.norm(accel)))

    @property
    def rate_hz(self) -> float | None:
        """Of what the stream takes, the quantity that comes first in the rig."""
        rates = (self.tally.rate_hz(n) for n in self.feed.values if n in self.tally.arrivals_s)
        return next((rate for rate in rates if rate is not None), None)

    def late_s(self, share: float) -> float | None:
        """By how much the latest readings come behind the fastest ones; None without a device's clock."""
        if len(self.delays_s) < 20:
            return None
        delays = np.array(self.delays_s)
        return float(np.quantile(delays, share) - delays.min())


@dataclass
class Arrivals:
    """All that a rig's sources delivered within some seconds."""

    rig: Rig
    streams: dict[str, StreamHeard] = field(default_factory=dict)
    senders: dict[tuple[str, str, str], DeviceArrivals] = field(default_factory=dict)
    damaged: dict[str, int] = field(default_factory=dict)
    readings: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: Rig, hearings: Sequence[Hearing]) -> Arrivals:
        """Decode what was heard."""
        found = cls(rig, {feed.stream: StreamHeard(feed) for feed in rig.feeds})
        for hearing in hearings:
            for address, packets in hearing.by_address().items():
                found._take(hearing, address, packets)
        return found

    def of_source(self, name: str) -> list[DeviceArrivals]:
        """The devices of a source."""
        return [sender for sender in self.senders.values() if sender.source == name]

    def _take(self, hearing: Hearing, address: str, packets: Sequence[Packet]) -> None:
        source = hearing.source
        decoder: Decoder = DECODERS[source.format].decoder(source.transport, **dict(source.decoder))
        for packet in packets:
            for reading in decoder.decode(packet.data, packet.channel):
                self.readings[source.name] = self.readings.get(source.name, 0) + 1
                sender = self._sender(source.name, address, reading.device)
                arrival_s = packet.arrival_ns / 1e9
                sender.tally.add(reading, arrival_s)
                for stream in sender.streams:
                    self.streams[stream].take(sender, reading, arrival_s)
        self.damaged[source.name] = self.damaged.get(source.name, 0) + decoder.damaged

    def _sender(self, source: str, address: str, part: str) -> DeviceArrivals:
        key = (source, address, part)
        if key not in self.senders:
            self.senders[key] = DeviceArrivals(*key, tuple(self._fed(source, address, part)))
        return self.senders[key]

    def _fed(self, source: str, address: str, part: str) -> Iterator[str]:
        for feed in self.rig.feeds:
            if feed.source == source and feed.takes(address, part):
                yield feed.stream
