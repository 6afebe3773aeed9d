"""Which format fits what a sender sent: all decoders of its transport are tried, and the one that reads most is it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from oarlock.live.decoders import DECODERS
from oarlock.live.reading import Packet, Reading, Value
from oarlock.live.rig import Source
from oarlock.live.scan.finding import BATTERY, DevicePart
from oarlock.storage.errors import DataError

_ORDER = ("lines", "mvn", "nmea", "osc", "ngimu", "vicon", "ximu3")
"""Of formats that read the same bytes equally well, the plainer one first."""
_TELLING = {
    "gyro_rad_s", "accel_m_s2", "mag_ut", "mag_arbitrary", "quat_wxyz", "position_m", "value", BATTERY,
    "speed_m_s", "latitude_deg", "gyro_unknown_unit", "rotation_xyz_rad",
}  # fmt: skip
"""Quantities that no decoder finds by chance."""
_EMPTY = {"command"}
"""What the decoder of x-IMU3 makes of any JSON."""


@dataclass
class Tally:
    """The readings of one part."""

    arrivals_s: dict[str, list[float]] = field(default_factory=dict)
    clocks_s: dict[str, list[float]] = field(default_factory=dict)
    counts: set[int] = field(default_factory=set)
    battery_percent: float | None = None
    last: dict[str, Value] = field(default_factory=dict)

    def add(self, reading: Reading, arrival_s: float) -> None:
        """Count a reading."""
        for name, value in reading.values.items():
            self.last[name] = value
            self.arrivals_s.setdefault(name, []).append(arrival_s)
            if reading.clock_s is not None:
                self.clocks_s.setdefault(name, []).append(reading.clock_s)
            if name == BATTERY and isinstance(value, float | int):
                self.battery_percent = float(value)
        if reading.count is not None:
            self.counts.add(reading.count)

    def part(self, name: str) -> DevicePart:
        """All of it, as a part of this name."""
        rates_hz = {key: self.rate_hz(key) for key in self.arrivals_s}
        return DevicePart(name, rates_hz, self.battery_percent, self.lost_percent(), self.last)

    def rate_hz(self, name: str) -> float | None:
        """Rate of a quantity: by the device's clock where it has one, because arrivals come in bursts."""
        for times in (self.clocks_s.get(name, []), self.arrivals_s[name]):
            span_s = max(times) - min(times) if len(times) > 2 else 0.0
            if len(times) == len(self.arrivals_s[name]) and span_s > 0.0:
                share = 1.0 - (self.lost_percent() or 0.0) / 100.0
                return (len(times) - 1) / span_s / share
        return None

    def lost_percent(self) -> float | None:
        """Readings that its counter shows to be missing; None without a counter."""
        if len(self.counts) < 2:
            return None
        expected = max(self.counts) - min(self.counts) + 1
        # A counter that was set again, or that counts something else, tells nothing.
        return 100.0 * (1.0 - len(self.counts) / expected) if expected < 3 * len(self.counts) else None


@dataclass(frozen=True)
class Recognised:
    """What a format makes of what a sender sent.

    Args:
        format: name of the format.
        parts: what was decoded.
        readings: how many.
        damaged: messages that it could not decode.
    """

    format: str
    parts: tuple[DevicePart, ...]
    readings: int
    damaged: int


def recognised(packets: Sequence[Packet], source: Source) -> Recognised | None:
    """What the packets of one sender are; None if no format reads most of them.

    Args:
        packets: in the order of arrival.
        source: its transport; its format, if that is known, is the only one that is tried.
    """
    names = (source.format,) if source.format else _formats(source.transport)
    tried = [
        (weight, found) for weight, found in (_tried(packets, source, name) for name in names) if weight > 0
    ]
    return max(tried, key=lambda one: one[0])[1] if tried else None


def decoded(packets: Sequence[Packet], source: Source, name: str) -> Recognised:
    """What a format makes of the packets of one sender."""
    return _tried(packets, source, name)[1]


def _formats(transport: str) -> list[str]:
    known = [name for name, one in DECODERS.items() if transport in one.transports]
    return sorted(known, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))


def _tried(packets: Sequence[Packet], source: Source, name: str) -> tuple[int, Recognised]:
    """How well a format fits, above 0 if it may be it, and what it makes of the packets."""
    if name not in DECODERS:
        raise DataError(f"the format {name} is unknown; expected one of {', '.join(sorted(DECODERS))}")
    decoder = DECODERS[name].decoder(source.transport, **dict(source.decoder))
    tallies: dict[str, Tally] = {}
    weight = readings = 0
    for packet in packets:
        for reading in decoder.decode(packet.data, packet.channel):
            if reading.values.keys() <= _EMPTY:
                continue
            readings += 1
            weight += 2 if reading.values.keys() & _TELLING else 1
            tallies.setdefault(reading.device, Tally()).add(reading, packet.arrival_ns / 1e9)
    parts = tuple(tally.part(part) for part, tally in sorted(tallies.items()))
    return weight - 3 * decoder.damaged, Recognised(name, parts, readings, decoder.damaged)
