"""The rig of emulated devices: a sensor of the model for each stream that they send."""

from __future__ import annotations

from oarlock._core import Model
from oarlock.live.emulators.emulated import Emulated
from oarlock.live.emulators.kinds import EmulatorKind
from oarlock.live.rig import Feed, Rig, Source, streams_of

LINES = "lines"


def rig_of(kind: EmulatorKind, emulated: Emulated, model: Model, name: str) -> Rig:
    """The rig file's content that receives what a kind sends on this machine.

    Args:
        kind: that emulates.
        emulated: as `EmulatorKind.emulated` gives it.
        model: of the body.
        name: of the model, as a rig file has it.
    """
    wired, known = kind.device.wiring(emulated), streams_of(model)
    sources = {
        own.source: Source(own.source, wired.format, own.transport, own.options, wired.decoder)
        for own in wired.senders.values()
    }
    feeds = []
    for stream in emulated.recording.streams:
        if stream.name not in wired.streams or stream.name not in known:
            continue
        own, (shape, values) = wired.senders[wired.streams[stream.name][0]], known[stream.name]
        carried = tuple(v for v in values if shape != "imu" or v in wired.values)
        rate_hz = round(stream.rate_hz, 3)
        feeds.append(Feed(stream.name, shape, own.source, wired.device(stream.name), carried, rate_hz))
    return Rig(name, None, sources, tuple(feeds))


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
