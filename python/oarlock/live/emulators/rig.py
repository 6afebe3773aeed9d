"""The rig of emulated units: JSON lines by UDP, a device for each stream of a recording."""

from __future__ import annotations

from oarlock._core import Model
from oarlock.live.rig import Feed, Rig, Source, streams_of

LINES = "lines"


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
