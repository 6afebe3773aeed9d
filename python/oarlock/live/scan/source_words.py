"""Sources in the words of the command line: `udp:9000`, `tcp:192.168.1.5:7000:ximu3`, `ws://192.168.1.20/websocket`."""

from __future__ import annotations

import re

from oarlock.live.decoders import DECODERS
from oarlock.live.rig import Source
from oarlock.storage.errors import DataError

FORMS = (
    "udp:PORT, tcp:HOST:PORT, serial:DEVICE[@BAUD], ble:FORMAT:ADDRESS, lsl:NAME, ws://HOST[:PORT]/PATH, "
    "mqtt://HOST[:PORT]/TOPIC or replay:FOLDER"
)
_UDP = re.compile(r"(\d+)")
_TCP = re.compile(r"(.+):(\d+)")
_SERIAL = re.compile(r"([^@]+)(?:@(\d+))?")
_BLE = re.compile(r"(\w+):(.+)")
_MQTT = re.compile(r"//([^/:]+)(?::(\d+))?/(.+)")


def source_of(text: str) -> Source:
    """A source; its name is empty, and its format too, if the words have none.

    Raises:
        DataError: the words are none of `FORMS`.
    """
    transport, _, rest = text.strip().partition(":")
    if transport == "ble" and (found := _BLE.fullmatch(rest)):
        return _checked(text, Source("", found[1], "ble", {"addresses": [found[2]]}))
    if transport == "lsl" and rest:
        return Source("", "lsl", "lsl", {"name": rest})
    if transport in ("ws", "wss") and rest.startswith("//"):
        return Source("", "", "websocket", {"url": text.strip()})
    if transport in ("mqtt", "mqtts") and (found := _MQTT.fullmatch(rest)):
        return Source("", "", "mqtt", _broker(transport, *found.groups()))
    place, _, name = rest.rpartition(":")
    if name not in DECODERS or not place:
        place, name = rest, ""
    options = _options(transport, place)
    if options is None:
        raise DataError(
            f"--source {text}: expected {FORMS}; udp, tcp, serial and replay may end with :FORMAT"
        )
    return _checked(text, Source("", name, transport, options))


def _options(transport: str, place: str) -> dict[str, object] | None:
    if transport == "udp" and (found := _UDP.fullmatch(place)):
        return {"port": int(found[1])}
    if transport == "tcp" and (found := _TCP.fullmatch(place)):
        return {"host": found[1], "port": int(found[2])}
    if transport == "serial" and (found := _SERIAL.fullmatch(place)):
        return {"device": found[1]} | ({"baud": int(found[2])} if found[2] else {})
    return {"folder": place} if transport == "replay" and place else None


def _broker(scheme: str, host: str, port: str | None, topic: str) -> dict[str, object]:
    """Options of a broker, as `mqtt://HOST:PORT/TOPIC` has them; `mqtts` is encrypted."""
    found: dict[str, object] = {"host": host, "topic": topic}
    if port:
        found["port"] = int(port)
    if scheme == "mqtts":
        found["tls"] = True
    return found


def words_of(source: Source) -> str:
    """What a rig file has of a source, on one line: `transport = "udp", port = 9000`."""
    from oarlock.storage.toml import toml_text

    told = {"format": source.format, "transport": source.transport, **source.options}
    return ", ".join(toml_text(told).strip().splitlines())


def _checked(text: str, source: Source) -> Source:
    known = [name for name, one in DECODERS.items() if source.transport in one.transports]
    if source.transport != "replay" and source.format and source.format not in known:
        raise DataError(
            f"--source {text}: {source.transport} does not carry the format {source.format}; "
            f"it carries {', '.join(known)}"
        )
    return source
