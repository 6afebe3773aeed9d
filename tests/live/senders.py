"""Recordings as packets of simulated senders: devices with clocks of their own, queues, losses and bursts."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np

from oarlock.live.decoders import DECODERS, Format
from oarlock.live.reading import Packet, Reading
from oarlock.live.rig import Feed, Rig, Source, streams_of

START_NS = 5_000_000_000_000


@dataclass
class JsonDecoder:
    """One reading a packet, as JSON: the plainest wire format."""

    damaged: int = 0
    known: list[str] = field(default_factory=list)

    def decode(self, data, channel=""):
        try:
            told = json.loads(data)
        except ValueError:
            self.damaged += 1
            return []
        values = {k: tuple(v) if isinstance(v, list) else v for k, v in told["values"].items()}
        return [Reading(told.get("part") or "", told["clock_s"], values, told["count"])]


class JsonFormat(Format):
    def decoder(self, **options):
        return JsonDecoder()


FORMAT = JsonFormat("test-json", "", ("udp",), "one reading a packet")


def with_test_format(monkeypatch):
    """Lets rigs name the format of these senders."""
    import oarlock.live.session as session

    monkeypatch.setattr(session, "DECODERS", {**DECODERS, FORMAT.name: FORMAT})


def rig_of(model, recording, **keys):
    """Each stream of a recording from a device of its own."""
    kinds = streams_of(model)
    feeds = [
        Feed(
            s.name,
            kinds[s.name][0],
            "radio",
            s.name,
            kinds[s.name][1],
            1 / float(np.median(np.diff(s.time_s))),
        )
        for s in recording.streams
    ]
    return Rig("test", None, {"radio": Source("radio", FORMAT.name, "udp")}, tuple(feeds), **keys)


def packets_of(recording, seed=0, *, drift_ppm=0.0, queue_s=2e-3, loss=0.0, least_s=1e-3, part=False):
    """Packets in the order of arrival; clocks start anywhere and drift up or down by `drift_ppm`."""
    rng = np.random.default_rng(seed)
    found = []
    for stream in recording.streams:
        time_s = stream.time_s
        zero_s, drift = rng.uniform(0, 1000), 1e-6 * drift_ppm * rng.choice([-1, 1])
        arrival_s = np.maximum.accumulate(time_s + least_s + rng.exponential(queue_s, len(time_s)))
        kept = rng.random(len(time_s)) >= loss
        for row in np.flatnonzero(kept):
            values = {name: value[row].tolist() for name, value in stream.values.items()}
            told = {
                "part": part and stream.name,
                "clock_s": zero_s + (1 + drift) * time_s[row],
                "count": int(row),
                "values": values,
            }
            arrival_ns = START_NS + int(1e9 * arrival_s[row])
            address = "" if part else stream.name
            found.append(Packet("radio", address, "", arrival_ns, json.dumps(told).encode()))
    return sorted(found, key=lambda packet: packet.arrival_ns)
