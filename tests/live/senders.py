"""Recordings as packets of emulated devices, in the plainest wire format."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from oarlock.live.decoders import DECODERS, WireFormat
from oarlock.live.reading import Packet, Reading
from oarlock.live.rig import Feed, Rig, Source, streams_of
from oarlock.live.simulated_devices import Faults, deliveries

START_NS = 5_000_000_000_000


@dataclass
class JsonDecoder:
    """One reading a packet, as JSON with all digits of its stamp."""

    damaged: int = 0

    def decode(self, data, channel=""):
        try:
            told = json.loads(data)
        except ValueError:
            self.damaged += 1
            return []
        values = {k: tuple(v) if isinstance(v, list) else v for k, v in told["values"].items()}
        return [Reading(told["device"], told["clock_s"], values, told["count"])]


class JsonFormat(WireFormat):
    def decoder(self, transport="", **options):
        return JsonDecoder()


FORMAT = JsonFormat("test-json", "", ("udp",), "one reading a packet")


def with_test_format(monkeypatch):
    """Lets rigs name the format of these devices."""
    import oarlock.live.session as session

    monkeypatch.setattr(session, "DECODERS", {**DECODERS, FORMAT.name: FORMAT})


def encoded(delivery):
    told = {"device": delivery.device, "clock_s": delivery.clock_s, "count": delivery.count}
    return json.dumps({**told, "values": delivery.values}).encode()


def rig_of(model, recording, transport=None, **keys):
    """Each stream of a recording from a device of its own."""
    kinds = streams_of(model)
    feeds = [
        Feed(
            s.name,
            *(kinds[s.name][0], "radio", s.name, kinds[s.name][1]),
            float(1 / np.median(np.diff(s.time_s))),
        )
        for s in recording.streams
    ]
    radio = Source("radio", FORMAT.name, "udp", transport or {})
    return Rig("sculler", None, {"radio": radio}, tuple(feeds), **keys)


def packets_of(recording, seed=0, **faults):
    """Packets in the order of arrival."""
    return [
        Packet("radio", "", "", START_NS + int(1e9 * one.due_s), encoded(one))
        for one in deliveries(recording, Faults(**faults), seed)
    ]
